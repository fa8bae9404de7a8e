//! Controllers that are not as they should be, or as ours are, and lines that break in the middle.

use crate::bench::Bench;
use crate::rig::Ran;
use crate::up::Place;
use serde_json::Value as Json;
use std::fs;
use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread;
use stepdrive_proto::smd3::{LineBuf, decode_line, encode_reply};
use stepdrive_spec::smd3::commands::{Command, Kind, Mode, Reply, Request, Value};
use stepdrive_spec::smd3::flags::{Flags, StatusFlag};
use stepdrive_spec::smd3::text::Text;

/// Serves every connection that is made to a free port, in a thread that ends with the test.
fn serve(mut talk: impl FnMut(TcpStream) -> io::Result<()> + Send + 'static) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address");
    thread::spawn(move || {
        for stream in listener.incoming().map_while(Result::ok) {
            // Who hangs up has heard enough.
            let _ = talk(stream);
        }
    });
    address
}

/// An SMD3 that says yes to every setting and keeps none.
fn forgetful() -> SocketAddr {
    smd3(|line| {
        let mut out = LineBuf::new();
        encode_reply(&mut out, &reply(line));
        out.to_vec()
    })
}

/// An SMD3 that answers a line as it is told to.
fn smd3(mut answer: impl FnMut(&[u8]) -> Vec<u8> + Send + 'static) -> SocketAddr {
    serve(move |mut stream| {
        let mut input = Vec::new();
        loop {
            let mut bytes = [0; 256];
            let count = stream.read(&mut bytes)?;
            if count == 0 {
                return Ok(());
            }
            input.extend_from_slice(&bytes[..count]);
            while let Some(end) = input.windows(2).position(|end| end == b"\r\n") {
                let line: Vec<u8> = input.drain(..end + 2).take(end).collect();
                stream.write_all(&answer(&line))?;
            }
        }
    })
}

fn reply(line: &[u8]) -> Reply {
    let flags = Flags { status: StatusFlag::Standby.mask(), error: 0 };
    let outcome = decode_line(line).map(|request| request.and_then(|request| value(&request)));
    Reply { flags, outcome }
}

/// A setting is answered with what was sent, a question with what it left the factory with.
fn value(request: &Request) -> Option<Value> {
    let default = request.command.info().default;
    let factory = match request.command.info().kind {
        Kind::None | Kind::Sign => return None,
        Kind::Text => Value::Text(Text::new("20168-001").expect("short")),
        _ if request.command == Command::Mode => Value::Mode(Mode::Remote),
        Kind::Float => Value::Float(default),
        Kind::Bool => Value::Bool(default > 0.5),
        // Whole and small.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole, and not negative")]
        Kind::Int | Kind::Uint => Value::Uint(default as u64),
    };
    Some(request.argument.unwrap_or(factory))
}

#[test]
fn settings_that_do_not_read_back_end_with_10_and_are_not_stored() {
    let place = Place::new();
    let at = forgetful();
    fs::write(place.path("p.toml"), "model = \"SMD3\"\n[settings]\nVMAX = 500\nIR = 1.0\nL = 1\n")
        .expect("written");
    let ran = Ran(place.run(&format!("settings apply p.toml -a smd3+tcp://{at} --store")));
    assert_eq!(ran.code(), 10, "{}", ran.stderr());
    assert!(
        ran.stdout().ends_with("L        1 (on)  0 (off)\nVMAX     500 Hz  1000 Hz\n"),
        "{}",
        ran.stdout()
    );
    assert!(
        ran.stderr().contains("2 settings of") && ran.stderr().contains("nothing was stored"),
        "{}",
        ran.stderr()
    );
    let ran = Ran(place.run(&format!("settings apply p.toml -a smd3+tcp://{at} --json")));
    assert_eq!(ran.code(), 10);
    let told: Json = serde_json::from_str(ran.stdout()).expect("JSON");
    assert_eq!((&told["verified"], &told["stored"]), (&false.into(), &false.into()));
    let names: Vec<&Json> =
        told["differences"].as_array().expect("a list").iter().map(|one| &one["name"]).collect();
    assert_eq!(names, ["L", "VMAX"]);
}

#[test]
fn a_drive_that_does_not_round_as_ours_does_is_as_the_profile_that_was_saved_of_it() {
    let place = Place::new();
    let at = forgetful();
    let run = |words: &str| Ran(place.run(&format!("settings {words} p.toml -a smd3+tcp://{at}")));
    run("save").done();
    let text = fs::read_to_string(place.path("p.toml")).expect("written");
    assert!(text.contains("\nTHIGH = 500 "), "{text}");
    let same = format!("smd3+tcp://{at} is as p.toml says\n");
    assert_eq!(run("diff").done(), same);
    assert_eq!(run("apply").done(), same);
    fs::write(place.path("p.toml"), text.replace("\nTHIGH = 500 ", "\nTHIGH = 600 ")).expect("written");
    assert_eq!(run("diff").code(), 10);
}

#[test]
fn a_command_that_a_drive_refuses_is_one_row_of_regs_without_a_value_and_flags_is_not_asked() {
    let place = Place::new();
    let asked = Arc::new(Mutex::new(Vec::new()));
    let lines = Arc::clone(&asked);
    let at = smd3(move |line| {
        let name = String::from_utf8_lossy(line).into_owned();
        lines.lock().expect("whole").push(name.clone());
        let says = match name.as_str() {
            "TMOT" => "-5 (Action failed)",
            "RES" | "THIGH" => "-4 (Unknown command)",
            "VMAX" => "fast",
            _ => {
                let mut out = LineBuf::new();
                encode_reply(&mut out, &reply(line));
                return out.to_vec();
            }
        };
        format!("0x0040,0x0000,{says}\r\n").into_bytes()
    });
    let ran = Ran(place.run(&format!("regs -a smd3+tcp://{at} --json")));
    let regs: Json = serde_json::from_str(ran.done()).expect("JSON");
    let rows = regs["rows"].as_array().expect("rows");
    let row = |name: &str| rows.iter().find(|row| row["name"] == name).expect("there");
    for (name, why) in [
        ("TMOT", "TMOT refused (-5, Action failed)"),
        ("RES", "-4"),
        ("THIGH", "-4"),
        ("VMAX", "what cannot be understood"),
    ] {
        let error = row(name)["error"].as_str().expect("a reason");
        assert!(row(name)["value"].is_null() && error.contains(why), "{}", row(name));
    }
    assert_eq!((&row("IR")["value"], row("IR").get("error")), (&1.into(), None));
    assert_eq!((&row("FLAGS")["value"], &row("FLAGS")["meaning"]), (&Json::Null, &"STANDBY".into()));
    assert!(!asked.lock().expect("whole").iter().any(|line| line == "FLAGS"));

    let ran = Ran(place.run(&format!("regs -a smd3+tcp://{at}")));
    let line = ran.done().lines().find(|line| line.starts_with("TMOT ")).expect("there");
    let words: Vec<&str> = line.split_whitespace().collect();
    assert_eq!(words[..4], ["TMOT", "-", "TMOT", "refused"], "{line}");
}

#[test]
fn a_drive_that_falls_silent_in_the_middle_of_regs_is_trouble_on_the_line() {
    let place = Place::new();
    let at = smd3(|line| {
        let mut out = LineBuf::new();
        encode_reply(&mut out, &reply(line));
        if line.starts_with(b"VMAX") { Vec::new() } else { out.to_vec() }
    });
    let ran = Ran(place.run(&format!("regs -a smd3+tcp://{at} --reply-timeout 100ms")));
    assert!(ran.refused(5).contains("did not answer within 100ms"));
}

/// A function code, and the address that it is about.
type Head = (u8, u16);

/// Passes requests on to a controller and replies back, each seen by `meddle` with the request's function and address
/// and the reply's bytes; the line breaks where it says `false`.
fn proxy(to: SocketAddr, mut meddle: impl FnMut(Head, &mut Vec<u8>) -> bool + Send + 'static) -> SocketAddr {
    serve(move |mut client| {
        let mut server = TcpStream::connect(to)?;
        loop {
            let request = frame(&mut client)?;
            server.write_all(&request)?;
            let mut reply = frame(&mut server)?;
            let head = (request[7], u16::from_be_bytes([request[8], request[9]]));
            if !meddle(head, &mut reply) {
                return Ok(());
            }
            client.write_all(&reply)?;
        }
    })
}

/// One frame of Modbus TCP.
fn frame(from: &mut TcpStream) -> io::Result<Vec<u8>> {
    let mut frame = vec![0; 6];
    from.read_exact(&mut frame)?;
    let length = usize::from(u16::from_be_bytes([frame[4], frame[5]]));
    frame.resize(6 + length, 0);
    from.read_exact(&mut frame[6..])?;
    Ok(frame)
}

#[test]
fn an_smsd_of_unknown_model_has_profiles_of_an_smsd() {
    let bench = Bench::start();
    let at = proxy(bench.address(0), |head, reply| {
        if head == (READ_INPUT, 0x8001) {
            reply[10] = 99;
        }
        true
    });
    let at = format!("smsd+tcp://{at}?unit=1");
    assert_eq!(
        bench.run(&format!("settings save p.toml -a {at}")).done(),
        format!("11 settings of {at} to p.toml\n")
    );
    let text = fs::read_to_string(bench.place().path("p.toml")).expect("written");
    assert!(text.contains("\nmodel = \"SMSD\"\n"), "{text}");
    for command in ["diff", "apply"] {
        let ran = bench.run(&format!("settings {command} p.toml -a {at}"));
        assert_eq!((ran.done(), ran.stderr()), (format!("{at} is as p.toml says\n").as_str(), String::new()));
    }
    let ran = bench.run("settings diff p.toml -a stage");
    assert_eq!(ran.code(), 0);
    assert_eq!(ran.stderr(), "p.toml was made for an SMSD of unknown model; stage is an SMSD-4.2LAN\n");
    let told = bench.run("settings diff p.toml -a uhv").refused(1);
    assert_eq!(told, "p.toml is for an SMSD of unknown model, and uhv is an SMD3");
}

const READ_INPUT: u8 = 4;
const READ: u8 = 3;
const WRITE: u8 = 6;

#[test]
fn a_program_that_does_not_read_back_ends_with_10() {
    let bench = Bench::start();
    bench.write("p.smsd", "SET_MAX_SPEED 800\nEND\n");
    let at = proxy(bench.address(0), |head, reply| {
        if head == (READ, 0x3100) {
            // The low word of the first instruction.
            reply[9] ^= 0x40;
        }
        true
    });
    let ran = bench.run(&format!("program store p.smsd --mem 0 -a {at}"));
    assert_eq!((ran.code(), ran.stdout()), (10, ""), "{}", ran.stderr());
    assert!(ran.stderr().contains("line 0 of memory 0 reads 0x"), "{}", ran.stderr());
}

#[test]
fn a_line_that_breaks_in_the_middle_leaves_a_word_on_what_was_set() {
    let bench = Bench::start();
    bench.write("p.toml", "model = \"SMSD-4.2LAN\"\n[settings]\nMAX_SPEED = 700\nACC = 500\nDEC = 500\n");
    // ACC is written, and nobody hears of it.
    let at = proxy(bench.address(0), |head, _| head != (WRITE, 0x1102));
    let ran = bench.run(&format!("settings apply p.toml -a {at}"));
    assert_eq!(ran.code(), 5, "{}", ran.stderr());
    assert!(ran.stderr().contains("MAX_SPEED had been set; DEC not tried"), "{}", ran.stderr());
    let read = bench.json("get -a stage MAX_SPEED DEC");
    assert_eq!((&read["values"][0]["value"], &read["values"][1]["value"]), (&700.into(), &1000.into()));
}

#[test]
fn a_command_typed_into_a_terminal_is_not_repeated_when_its_reply_is_lost() {
    let bench = Bench::in_real_time();
    bench.energise();
    bench.write("lines", "MOVE_F 160\n");
    let at = proxy(bench.address(0), |head, _| head != (WRITE, 0x1109));
    let mut command = bench.command(&format!("term -a {at}"));
    command.stdin(fs::File::open(bench.place().path("lines")).expect("there"));
    let ran = Ran(command.output().expect("started"));
    assert_eq!((ran.code(), ran.stdout()), (5, ""), "{}", ran.stderr());
    assert!(ran.stderr().contains("MOVE_F was sent, but its reply was lost"), "{}", ran.stderr());
    assert!(ran.stderr().contains("it was not sent again"), "{}", ran.stderr());
    crate::rig::until(|| bench.json("get -a stage READY")["values"][0]["value"] == 1);
    assert_eq!(bench.json("get -a stage ABS_POS")["values"][0]["value"], 160);
}
