//! `stepdrive plot`.

use crate::rig::Ran;
use crate::up::Place;
use expect_test::expect_file;
use std::collections::BTreeSet;
use std::fs;
use tiny_skia::Pixmap;

/// A move of 20 mm, recorded with a gap.
const MOVE: &str = include_str!("plots/move.csv");

fn place() -> Place {
    let place = Place::new();
    fs::write(place.path("move.csv"), MOVE).expect("written");
    place
}

fn plot(place: &Place, words: &str) -> Ran {
    Ran(place.run(&format!("plot {words}")))
}

/// What an SVG shows as text, in its order.
fn texts(svg: &str) -> Vec<&str> {
    let elements = svg.split("<text ").skip(1);
    elements.filter_map(|element| element.split_once('>')?.1.split_once('<').map(|(text, _)| text)).collect()
}

#[test]
fn a_recording_becomes_an_svg_with_a_panel_for_each_unit() {
    let place = place();
    let ran = plot(&place, "move.csv -o move.svg");
    assert_eq!((ran.code(), ran.stdout()), (0, ""));
    assert_eq!(ran.stderr(), "move.svg: 3 quantities of 41 rows\n");
    let svg = fs::read_to_string(place.path("move.svg")).expect("written");
    for text in
        ["move", "from 2026-11-22T12:00:00.000Z", "position [mm]", "speed [mm/s]", "TMOT [°C]", "time [s]"]
    {
        assert!(texts(&svg).contains(&text), "{text}: {:?}", texts(&svg));
    }
    expect_file!["plots/move.svg"].assert_eq(&svg);
}

#[test]
fn without_a_name_the_drawing_is_a_png_beside_the_recording() {
    let place = place();
    let ran = plot(&place, "move.csv --size 400x300");
    assert_eq!(ran.code(), 0, "{}", ran.stderr());
    let png = Pixmap::load_png(place.path("move.png")).expect("a PNG");
    assert_eq!((png.width(), png.height()), (800, 600));
    let colours: BTreeSet<[u8; 4]> = png.data().chunks(4).filter_map(|pixel| pixel.try_into().ok()).collect();
    for colour in [[255, 255, 255, 255], [0x00, 0x72, 0xb2, 255], [0xd5, 0x5e, 0x00, 255]] {
        assert!(colours.contains(&colour), "{colour:?}");
    }
}

#[test]
fn columns_are_chosen_by_name_with_or_without_the_axis() {
    let place = place();
    let ran = plot(&place, "move.csv -o move.svg --columns uhv.TMOT,speed --title Warm --json");
    assert_eq!(
        ran.done(),
        "{\"columns\":[\"uhv.TMOT [°C]\",\"stage.speed [mm/s]\"],\"file\":\"move.svg\",\"rows\":41}\n"
    );
    let svg = fs::read_to_string(place.path("move.svg")).expect("written");
    let texts = texts(&svg);
    assert_eq!(texts[0], "Warm");
    assert!(texts.contains(&"TMOT [°C]") && !texts.contains(&"position [mm]"), "{texts:?}");
    let told = plot(&place, "move.csv -o other.svg --columns sped").refused(1);
    assert_eq!(told, "move.csv: there is no `sped` in it; there are stage.position, stage.speed, uhv.TMOT");
    assert!(!place.path("other.svg").exists());
}

#[test]
fn a_drawing_that_is_there_is_replaced_only_when_asked() {
    let place = place();
    fs::write(place.path("move.svg"), "mine").expect("written");
    let told = plot(&place, "move.csv -o move.svg").refused(1);
    assert_eq!(told, "move.svg exists; --force replaces it");
    assert_eq!(fs::read_to_string(place.path("move.svg")).ok().as_deref(), Some("mine"));
    assert_eq!(plot(&place, "move.csv -o move.svg --force").code(), 0);
    assert!(fs::read_to_string(place.path("move.svg")).is_ok_and(|svg| svg.starts_with("<svg ")));
}

#[test]
fn what_cannot_be_drawn_is_told_in_a_sentence() {
    let place = place();
    let with = |name: &str, text: &str| fs::write(place.path(name), text).expect("written");
    with("empty.csv", "time [s],utc,a.position [mm]\n");
    with("bare.csv", "time [s],utc\n0,x\n");
    with("foreign.csv", "t,x\n0,1\n");
    with("broken.csv", "time [s],a\n0,1\n1,one\n");
    with("far.csv", "time [s],a\n0,-1.7e308\n1,1.7e308\n");
    with("cut.parquet", "PAR1PAR1");
    for (words, told) in [
        ("none.csv", "cannot read none.csv: No such file or directory (os error 2)"),
        (
            "move.txt",
            "move.txt: a recording's name ends in .csv or .parquet, which says what it is written in",
        ),
        (
            "move.csv -o a.jpg",
            "a.jpg: a drawing's name ends in .png or .svg, which says what it is written as",
        ),
        ("empty.csv", "empty.csv: there are no rows in it"),
        ("bare.csv", "bare.csv: there are no quantities in it"),
        (
            "foreign.csv",
            "cannot read foreign.csv: it is no recording of `stepdrive record`: its first column is not `time [s]`",
        ),
        ("broken.csv", "cannot read broken.csv: row 2, column `a`: `one` is no number"),
        ("far.csv", "far.csv: the values in `a` cannot be drawn"),
    ] {
        assert_eq!(plot(&place, words).refused(1), told);
    }
    let cut = plot(&place, "cut.parquet").refused(1);
    assert!(cut.starts_with("cannot read cut.parquet: it is no whole Parquet file: "), "{cut}");
}
