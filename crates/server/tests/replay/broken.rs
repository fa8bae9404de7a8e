//! Recordings that are cut short, changed, of another version, or none at all.

use crate::bench::{Bench, read, replay_it, replayed};
use crate::session::recorded;
use stepdrive_server::replay::ReplayError;
use stepdrive_spec::smsd::registers::Reg;

const RIG: &str = r#"
    [[drive]]
    name = "stage"
    model = "SMSD-4.2LAN"
    modbus_tcp = "127.0.0.1:0"
    [[drive]]
    name = "uhv"
    model = "SMD3"
    serial_tcp = "127.0.0.1:0"
"#;

/// A recording of few lines.
async fn short() -> String {
    let bench = Bench::start(RIG).await;
    let (mut stage, mut uhv) = (bench.smsd(0).await, bench.smd3(1).await);
    let frame = stage.frame(1, &read(Reg::HwMajor, 2));
    stage.tell(&frame).await;
    bench.act("input stage.IN0 1");
    uhv.tell(b"RUNV,+\r\n").await;
    uhv.tell(b"VMAX,500\r\n").await;
    bench.stop().await
}

/// Replays it with the line that has `find` changed.
fn changed(recording: &str, find: &str, change: impl Fn(&str) -> String) -> Result<(), String> {
    assert_eq!(recording.lines().filter(|line| line.contains(find)).count(), 1, "{find}");
    let lines =
        recording.lines().map(|line| if line.contains(find) { change(line) } else { line.to_owned() });
    let changed = lines.map(|line| line + "\n").collect::<String>();
    replayed(changed).map(drop).map_err(|error| error.to_string())
}

fn line_with(recording: &str, find: &str) -> usize {
    1 + recording.lines().position(|line| line.contains(find)).expect("a line")
}

#[test]
fn a_recording_cut_behind_any_line_is_judged_as_far_as_it_goes() {
    let mut end = 0;
    // Of a long one every 37th, and the last.
    let lines: Vec<&str> = recorded().split_inclusive('\n').collect();
    for (number, line) in lines.iter().enumerate() {
        end += line.len();
        let is_last = number == lines.len() - 1;
        if number % 37 == 0 || number + 5 > lines.len() {
            let replayed = replay_it(&recorded()[..end]);
            assert_eq!((replayed.cut_short, replayed.end.is_none()), (!is_last, !is_last));
            assert!(replayed.identical && !replayed.altered, "{number}: {replayed}");
            assert_eq!(replayed.entries, number);
        }
    }
}

#[tokio::test]
async fn a_recording_cut_at_any_byte_is_judged_as_far_as_it_goes() {
    let recording = short().await;
    let header = recording.find('\n').expect("a line");
    for end in header..recording.len() {
        let replayed = replay_it(&recording[..end]);
        let whole =
            recording[..end].lines().filter(|line| line.ends_with('}') && line.starts_with("{\"t\"")).count();
        // A line of which only the end is missing counts; one that ends within its inner object does not.
        assert!(replayed.entries <= whole && replayed.entries + 1 >= whole);
        assert!(replayed.identical, "cut at {end}: {replayed}");
        assert_eq!(replayed.cut_short, end < recording.len() - 1, "cut at {end}");
    }
    for end in (0..header).step_by(97).chain(header - 5..header) {
        let error = replayed(&recording[..end]).expect_err("no whole header").to_string();
        assert!(error.starts_with("line 1: this is no recording of stepdrive"), "{error}");
    }
}

#[tokio::test]
async fn a_flipped_bit_is_an_error_or_seen() {
    let recording = short().await.into_bytes();
    let header = recording.iter().position(|byte| *byte == b'\n').expect("a line");
    let sampled = (0..header).step_by(61).chain(header..recording.len());
    for (number, at) in sampled.enumerate() {
        let mut flipped = recording.clone();
        flipped[at] ^= 1 << (number % 8);
        match replayed(&flipped) {
            Ok(replayed) => assert!(!replayed.identical || replayed.cut_short, "byte {at}: {replayed}"),
            Err(error) => assert!(error.to_string().starts_with("line "), "byte {at}: {error}"),
        }
    }
}

#[tokio::test]
async fn a_changed_reply_is_found_with_its_line_and_the_request_for_people() {
    let recording = short().await;
    let line = line_with(&recording, "\"rx\":\"0001");
    let changed =
        recording.replace("\"tx\":\"00010000000701030400060001\"", "\"tx\":\"00010000000701030400060009\"");
    let changed = if changed == recording { recording.replacen("00060001", "00060009", 1) } else { changed };
    assert_ne!(changed, recording);
    let replayed = replay_it(&changed);
    assert!(!replayed.identical && replayed.altered);
    assert_eq!(replayed.differences, 1);
    let first = replayed.first_difference.as_ref().expect("a difference");
    assert_eq!((first.line, first.drive.as_str()), (line, "stage"));
    assert_eq!(first.request.means, "unit 1, read 2 of IR 8001 (HW_MAJOR)");
    assert_eq!((first.recorded.means.as_str(), first.replayed.means.as_str()), ("[6, 9]", "[6, 1]"));
    let said = replayed.to_string();
    for part in [
        "not identical: 1 difference; the first:",
        "unit 1, read 2 of IR 8001 (HW_MAJOR)",
        "[6, 9]",
        "[6, 1]",
        "changed after it was made",
    ] {
        assert!(said.contains(part), "{said}");
    }
    assert_eq!(replayed.digest, replay_it(&recording).digest, "the replay itself is the same");
}

#[tokio::test]
async fn a_changed_line_of_an_smd3_and_a_changed_state_are_found() {
    let recording = short().await;
    let [hundred, other] = ["564d41582c353030", "564d41582c353031"];
    let changed = recording.replace(hundred, other);
    let replayed = replay_it(changed);
    // The reply, and with it the state at the end.
    assert_eq!(replayed.differences, 2);
    let first = replayed.first_difference.expect("a difference");
    assert_eq!((first.request.means.as_str(), first.drive.as_str()), ("VMAX,501", "uhv"));
    assert!(
        first.recorded.means.ends_with("5.00000E+02") || first.recorded.means.contains("5.0"),
        "{first:?}"
    );

    let replayed = replay_it(recording.replace("input stage.IN0 1", "input stage.IN1 1"));
    let first = replayed.first_difference.expect("a difference");
    assert_eq!((first.drive.as_str(), first.request.means.as_str()), ("", "the state at the end"));
}

#[tokio::test]
async fn what_cannot_have_happened_is_an_error_with_its_line() {
    let recording = short().await;
    let number = |find: &str| line_with(&recording, find);
    let (act, open) = (number("\"do\""), number("\"conn\":1,\"drive\""));
    let last = recording.lines().count();
    let swap = |from: &'static str, to: &'static str| move |line: &str| line.replace(from, to);
    for (find, from, to, line, told) in [
        ("\"do\"", "IN0", "IN9", act, "IN9"),
        ("\"do\"", "\"do\"", "\"did\"", act, "this is no entry of a recording"),
        ("\"do\"", "1\"}", "1\",\"do\":\"x\"}", act, "one thing that happened"),
        ("\"do\"", "{\"t\"", "{\"x\":1,\"t\"", act, "begins with `t`"),
        ("\"do\"", "\"t\":", "\"t\":-", act, "this is no entry"),
        ("\"drive\":0", "\"drive\":0", "\"drive\":7", open, "the rig has no drive 7"),
        ("\"drive\":0", "\"drive\":0", "\"drive\":0,\"why\":1", open, "unknown field `why`"),
        ("\"rx\":\"0001", "\"rx\":\"00", "\"rx\":\"0x", number("\"rx\":\"0001"), "hexadecimal"),
        ("\"rx\":\"0001", "\"rx\":\"00", "\"rx\":\"0", number("\"rx\":\"0001"), "hexadecimal"),
        ("\"rx\":\"0001", "\"rx\":\"0001", "\"rx\":\"", number("\"rx\":\"0001"), "no Modbus frame"),
        ("\"rx\":\"0001", "\",\"tx", "00\",\"tx", number("\"rx\":\"0001"), "more than one request"),
        ("\"rx\":\"52554e", "0d\"", "\"", number("\"rx\":\"52554e"), "no whole line"),
        ("\"rx\":\"52554e", "\"rx\":\"", "\"rx\":\"0a", number("\"rx\":\"52554e"), "more than one request"),
        (
            "\"rx\":\"52554e",
            "\"conn\":2",
            "\"conn\":3",
            number("\"rx\":\"52554e"),
            "connection 3 is not open",
        ),
        ("\"end\"", "{\"t\":", "{\"t\":1,\"clock\":\"real\"}\n{\"t\":1,\"x\":", last + 1, "this is no entry"),
        ("\"end\"", "}}", "}}\n{\"t\":1,\"clock\":\"real\"}", last + 1, "nothing comes after the end"),
    ] {
        let error = changed(&recording, find, swap(from, to)).expect_err(told);
        assert!(
            error.starts_with(&format!("line {line}: ")) && error.contains(told),
            "{error}\nnot: line {line} {told}"
        );
    }
    let earlier =
        |line: &str| line.find(',').map_or_else(String::new, |comma| format!("{{\"t\":0{}", &line[comma..]));
    let error = changed(&recording, "\"rx\":\"0001", earlier).expect_err("time went back");
    assert!(
        error.contains("this is at 0.000000000 s, and the line before it of the same drives was at"),
        "{error}"
    );
    let later = |line: &str| {
        line.find(',')
            .map_or_else(String::new, |comma| format!("{{\"t\":9999999999999999999{}", &line[comma..]))
    };
    let error = changed(&recording, "\"end\"", later).expect_err("too late");
    assert!(error.contains("no rig has run for so long"), "{error}");
    let twice = recording.replacen("\"conn\":2,\"drive\"", "\"conn\":1,\"drive\"", 1);
    assert!(replayed(twice).expect_err("an error").to_string().contains("connection 1 is open already"));
}

#[tokio::test]
async fn a_store_that_never_was_cannot_fail() {
    let recording = short().await;
    for (conn, told) in [(1, "no request whose changes"), (2, "no STORE"), (3, "not open")] {
        let failed = format!(
            "\"drive\":{}}}}}\n{{\"t\":99999999999,\"not-stored\":{{\"conn\":{conn},\"tx\":\"\"}}}}\n",
            1
        );
        let broken = recording.replacen("\"drive\":1}}\n", &failed, 1);
        assert_ne!(broken, recording);
        let error = replayed(broken).expect_err("an error").to_string();
        assert!(error.contains(told), "{error}");
    }
}

#[tokio::test]
async fn another_version_and_what_is_no_recording_are_refused() {
    let recording = short().await;
    let newer = recording.replacen("\"stepdrive_recording\":1", "\"stepdrive_recording\":2", 1);
    let newer = newer.replacen("\"made_by\":\"", "\"later\":true,\"made_by\":\"9.", 1);
    let error = replayed(newer).expect_err("another version");
    assert!(matches!(error, ReplayError::Version { version: 2, .. }));
    let told = error.to_string();
    assert!(
        told.contains("version 2") && told.contains("reads version 1") && told.contains("made it, 9."),
        "{told}"
    );
    for none in
        ["", "\n", "[drive]\nname = 1\n", "{}\n", "[1]\n", "{\"stepdrive_recording\":\"1\"}\n", "\u{0}\u{1}"]
    {
        let error = replayed(none).expect_err("no recording").to_string();
        assert!(error.starts_with("line 1: this is no recording of stepdrive"), "{error}");
    }
    assert!(replayed([0xFF, 0xFE, b'\n']).is_err());
}

#[tokio::test]
async fn a_rig_that_is_wrong_or_not_that_of_the_memories_is_refused() {
    let recording = short().await;
    for (from, to, told) in [
        ("SMSD-4.2LAN", "SMSD-4.3LAN", "the rig of the recording: its line 4, column"),
        ("name = \\\"stage\\\"", "name = \\\"table\\\"", "not those whose memory"),
        ("\"memory\":[\"", "\"memory\":[\"00", "the recorded memory of stage is damaged"),
        ("\"memory\":[\"", "\"memory\":[\"zz", "the recorded memory of stage is damaged"),
        ("\"name\":\"uhv\"", "\"name\":\"uhv\",\"memory\":[\"00\"]", "the recorded memory of uhv is damaged"),
        (
            "\"name\":\"stage\"",
            "\"name\":\"stage\",\"damaged\":true",
            "the recorded memory of stage is damaged",
        ),
    ] {
        let wrong = recording.replacen(from, to, 1);
        assert_ne!(wrong, recording, "{from}");
        let error = replayed(wrong).expect_err("a wrong rig").to_string();
        assert!(error.starts_with("line 1: ") && error.contains(told), "{error}");
    }
}
