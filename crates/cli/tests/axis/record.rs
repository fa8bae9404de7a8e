//! `stepdrive record`.

use crate::rig::{Bench, Ran, until};
use chrono::DateTime;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::RowAccessor;
use serde_json::Value;
use std::fs;
use std::fs::File;
use std::io::{BufRead, BufReader, Write as _};
use std::net::TcpStream;
use std::process::{Child, Command};

const RIG: &str = r#"
[rig]
api = "127.0.0.1:0"
[[drive]]
name = "stage"
model = "SMSD-4.2LAN"
modbus_tcp = "127.0.0.1:0"
[[drive]]
name = "uhv"
model = "SMD3"
serial_tcp = "127.0.0.1:0"
"#;

/// A rig, and a stepdrive.toml with its axes: `stage` in mm, `uhv` in turns.
fn bench() -> Bench {
    let bench = Bench::with(RIG);
    let axes = format!(
        "[axis.stage]\nuri = \"smsd+tcp://{}\"\nunit = \"mm\"\nper_turn = 5.0\nsteps_per_rev = 200\n\
         [axis.uhv]\nuri = \"smd3+tcp://{}\"\nunit = \"turns\"\nsteps_per_rev = 200\n",
        bench.address(0),
        bench.address(1)
    );
    fs::write(bench.place.path("stepdrive.toml"), axes).expect("written");
    bench
}

fn record(bench: &Bench, words: &str) -> Ran {
    Ran(bench.place.run(&format!("record {words}")))
}

/// A recording that goes on; it is killed when a test gives up.
struct Recording(Option<Child>);

impl Recording {
    fn start(bench: &Bench, words: &str) -> Recording {
        let mut command = bench.place.command();
        Recording(Some(command.arg("record").args(words.split_whitespace()).spawn().expect("started")))
    }

    /// Sends it a signal and waits for its end.
    fn end(mut self, signal: &str) -> Ran {
        let child = self.0.take().expect("it runs");
        let sent = Command::new("kill").args([format!("-{signal}"), child.id().to_string()]).status();
        assert!(sent.is_ok_and(|status| status.success()));
        Ran(child.wait_with_output().expect("ended"))
    }
}

impl Drop for Recording {
    fn drop(&mut self) {
        if let Some(mut child) = self.0.take() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// A file of CSV: headings and rows.
fn csv(bench: &Bench, name: &str) -> (Vec<String>, Vec<Vec<String>>) {
    let mut reader = csv::Reader::from_path(bench.place.path(name)).expect("there");
    let fields = |record: &csv::StringRecord| record.iter().map(str::to_owned).collect::<Vec<String>>();
    let headings = fields(reader.headers().expect("headings"));
    (headings, reader.records().map(|record| fields(&record.expect("a whole row"))).collect())
}

/// How many lines a file has that may still be written.
fn lines(bench: &Bench, name: &str) -> usize {
    fs::read_to_string(bench.place.path(name)).map_or(0, |text| text.lines().count())
}

/// Says lines to the SMD3.
fn tell_smd3(bench: &Bench, lines: &[&str]) {
    let mut stream = BufReader::new(TcpStream::connect(bench.address(1)).expect("reachable"));
    for line in lines {
        stream.get_mut().write_all(format!("{line}\r\n").as_bytes()).expect("sent");
        let mut reply = String::new();
        stream.read_line(&mut reply).expect("answered");
        assert!(!reply.contains(",-"), "{line}: {reply}");
    }
}

#[test]
fn position_and_speed_of_all_axes_are_recorded_in_their_units() {
    let bench = bench();
    let ran = record(&bench, "--rate 20Hz --for 500ms -o run.csv");
    assert_eq!((ran.code(), ran.stdout()), (0, ""), "{}", ran.stderr());
    assert!(ran.stderr().starts_with("run.csv: "), "{}", ran.stderr());
    let (headings, rows) = csv(&bench, "run.csv");
    let quantities =
        ["stage.position [mm]", "stage.speed [mm/s]", "uhv.position [turns]", "uhv.speed [turns/s]"];
    assert_eq!(headings[..2], ["time [s]", "utc"]);
    assert_eq!(headings[2..], quantities);
    // A busy machine may leave some out.
    assert!((3..=10).contains(&rows.len()), "{rows:?}");
    let times: Vec<f64> = rows.iter().map(|row| row[0].parse().expect("seconds")).collect();
    assert!(times.is_sorted() && times[0] < 0.5, "{times:?}");
    for (row, time) in rows.iter().zip(&times) {
        let since = DateTime::parse_from_rfc3339(&row[1]).expect("a date")
            - DateTime::parse_from_rfc3339(&rows[0][1]).expect("a date");
        let seconds = since.num_milliseconds() as f64 / 1e3;
        assert!((seconds - (time - times[0])).abs() < 0.0021, "{row:?}");
        assert_eq!(row[2..], ["0", "0", "0", "0"]);
    }
}

#[test]
fn a_name_is_recorded_of_every_axis_that_knows_it_or_of_one() {
    let bench = bench();
    bench.rig("input stage.IN1 1").done();
    let ran = record(
        &bench,
        "-a uhv -a stage speed Inputs max_speed TMOT uhv.PACT --for 100ms -o run.parquet --json",
    );
    let told: Value = serde_json::from_str(ran.stdout()).expect("JSON");
    let said: Vec<&str> =
        told["columns"].as_array().expect("a list").iter().filter_map(Value::as_str).collect();
    let uhv = ["uhv.speed [turns/s]", "uhv.TMOT [°C]", "uhv.PACT [full steps]"];
    let stage = ["stage.speed [mm/s]", "stage.Inputs", "stage.MAX_SPEED [full steps/s]"];
    assert_eq!(said, [uhv, stage].concat());
    assert_eq!((ran.code(), &told["file"], &told["format"]), (0, &"run.parquet".into(), &"parquet".into()));
    assert!(DateTime::parse_from_rfc3339(told["started"].as_str().expect("a text")).is_ok());
    for key in ["duration_s", "rate_hz", "rows", "rows_left_out"] {
        assert!(told[key].is_number(), "{key}: {told}");
    }
    assert_eq!(told["gaps"], Value::Array(Vec::new()));
}

#[test]
fn a_recording_in_parquet_shows_a_move() {
    let bench = bench();
    let recording = Recording::start(&bench, "-a uhv position PACT --rate 50Hz -o run.parquet");
    until(|| bench.place.path("run.parquet").exists());
    tell_smd3(&bench, &["MODE,2", "AMAX,5000", "VMAX,1000", "RUNR,100"]);
    until(|| bench.drive(1)["position"] == 100.0);
    let ran = recording.end("INT");
    assert_eq!((ran.code(), ran.stdout()), (0, ""), "{}", ran.stderr());

    let reader = SerializedFileReader::new(File::open(bench.place.path("run.parquet")).expect("there"));
    let reader = reader.expect("a whole file");
    let fields = reader.metadata().file_metadata().schema().get_fields();
    let names: Vec<&str> = fields.iter().map(|field| field.name()).collect();
    assert_eq!(names, ["time [s]", "utc", "uhv.position [turns]", "uhv.PACT [full steps]"]);
    let rows: Vec<_> = reader.get_row_iter(None).expect("rows").map(|row| row.expect("a row")).collect();
    let values =
        |column| rows.iter().map(|row| row.get_double(column).expect("a value")).collect::<Vec<f64>>();
    let (turns, steps) = (values(2), values(3));
    assert!(turns.is_sorted() && steps.is_sorted() && turns[0] < 0.5, "{turns:?}");
    assert!(turns.last() > turns.first() && turns.last() <= Some(&0.5), "{turns:?}");
    assert!(rows[0].get_timestamp_micros(1).expect("a date") > 1_700_000_000_000_000);
}

#[test]
fn cells_are_empty_while_a_line_is_in_trouble_and_the_recording_goes_on() {
    let bench = bench();
    let words = "-a stage -a uhv position --rate 50Hz -o run.csv --reply-timeout 200ms --json";
    let recording = Recording::start(&bench, words);
    until(|| lines(&bench, "run.csv") > 10);
    bench.rig("fault stage.connection silent").done();
    until(|| fs::read_to_string(bench.place.path("run.csv")).is_ok_and(|text| text.contains("Z,,0\n")));
    bench.rig("fault stage.connection off").done();
    let is_back =
        |text: String| text.rsplit_once(",,0\n").is_some_and(|(_, after)| after.contains("Z,0,0\n"));
    until(|| fs::read_to_string(bench.place.path("run.csv")).is_ok_and(is_back));
    let ran = recording.end("INT");
    assert_eq!(ran.code(), 0, "{}", ran.stderr());

    let (_, rows) = csv(&bench, "run.csv");
    let empty = rows.iter().filter(|row| row[2].is_empty()).count();
    assert!(empty > 0 && rows.iter().all(|row| row[3] == "0"), "the other axis has no gap");
    let said = ran.stderr();
    let said: Vec<&str> = said.lines().collect();
    assert!(
        said[0].starts_with("stepdrive: stage: ")
            && said[0].ends_with("; its cells stay empty until it answers again"),
        "{said:?}"
    );
    assert!(said[1].starts_with("stepdrive: stage answers again after "), "{said:?}");
    let told: Value = serde_json::from_str(ran.stdout()).expect("JSON");
    assert_eq!(told["rows"], rows.len());
    assert_eq!(told["gaps"], serde_json::json!([{ "axis": "stage", "rows": empty }]));
}

#[test]
fn csv_survives_a_kill() {
    let bench = bench();
    let recording = Recording::start(&bench, "-a stage --rate 50Hz -o run.csv");
    until(|| lines(&bench, "run.csv") > 40);
    let before = lines(&bench, "run.csv");
    let child = recording.end("KILL");
    assert!(child.0.status.code().is_none());
    let text = fs::read_to_string(bench.place.path("run.csv")).expect("there");
    let (whole, _) = text.rsplit_once('\n').expect("lines");
    assert!(
        whole.lines().count() >= before - 1 && whole.lines().all(|line| line.split(',').count() == 4),
        "{text}"
    );
}

#[test]
fn a_recording_is_drawn() {
    let bench = bench();
    for file in ["run.csv", "run.parquet"] {
        assert_eq!(record(&bench, &format!("--for 200ms -o {file}")).code(), 0);
        let drawn = Ran(bench.place.run(&format!("plot {file} -o {file}.svg")));
        assert_eq!(drawn.code(), 0, "{}", drawn.stderr());
        let svg = fs::read_to_string(bench.place.path(&format!("{file}.svg"))).expect("written");
        assert!(svg.contains(">uhv.speed</text>") && svg.contains(">position [mm]</text>"), "{svg}");
    }
}

#[test]
fn what_cannot_be_recorded_is_refused_and_leaves_no_file() {
    let bench = bench();
    let nobody =
        std::net::TcpListener::bind("127.0.0.1:0").and_then(|socket| socket.local_addr()).expect("a port");
    for (words, code, told) in [
        ("-a stage nonsense -o run.csv", 1, "stage: there is no register `nonsense`; "),
        (
            "-a uhv TMOTT -o run.csv",
            1,
            "uhv: there is no command `TMOTT`; did you mean TMOT?; every axis has position and speed",
        ),
        ("-a uhv FLAGS -o run.csv", 1, "uhv: FLAGS does not read as a number"),
        ("-a uhv RUNV -o run.csv", 1, "uhv: RUNV does not read as a number"),
        ("-a stage CMD_none -o run.csv", 1, "stage: there is no register `CMD_none`; "),
        ("-a stage -o run.xlsx", 1, "run.xlsx: a recording's name ends in .csv or .parquet"),
        ("-a stage -o rig.toml", 1, "rig.toml: a recording's name ends in .csv or .parquet"),
        ("-a stag -o run.csv", 3, ""),
        (&format!("-a {nobody} -o run.csv"), 5, "cannot connect to "),
    ] {
        let said = record(&bench, words).refused(code);
        assert!(said.starts_with(told), "{words}: {said}");
        assert!(!bench.place.path("run.csv").exists(), "{words}");
    }
    fs::write(bench.place.path("run.csv"), "mine").expect("written");
    let said = record(&bench, "-a stage -o run.csv").refused(1);
    assert_eq!(said, "run.csv exists; --force replaces it");
    assert_eq!(record(&bench, "-a stage -o run.csv --for 50ms --force").code(), 0);
    assert!(lines(&bench, "run.csv") >= 1 && lines(&bench, "run.csv") < 4);
}

#[test]
fn rates_and_times_out_of_range_are_refused() {
    let bench = bench();
    for words in ["--rate 0Hz", "--rate 2000Hz", "--rate often", "--for 0s", "--for long"] {
        let ran = record(&bench, &format!("-a stage -o run.csv {words}"));
        assert_eq!((ran.code(), ran.stdout()), (1, ""), "{words}");
        assert!(!bench.place.path("run.csv").exists());
    }
}
