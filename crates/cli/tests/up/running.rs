//! A rig that runs, and how it ends.

use crate::bench::{Client, Place, Up, shown, text};
use expect_test::expect;
use stepdrive_spec::smsd::registers::Reg;

/// Two drives on free ports.
const TWO: &str = r#"
[[drive]]
name = "left"
model = "SMSD-4.2LAN"
modbus_tcp = "127.0.0.1:0"
[drive.mechanics]
travel = [-50.0, 2000.5]
[[drive.switch]]
input = "SET_ZERO"
closed = [-40.0, -30.0]
[[drive]]
name = "right"
model = "SMSD-8.0LAN"
modbus_tcp = "0.0.0.0:0"
motor.steps_per_rev = 400
"#;

#[test]
fn json_is_one_line_with_the_real_ports() {
    let place = Place::with(TWO);
    let up = place.up();
    let ready: serde_json::Value = serde_json::from_str(&up.ready).expect("JSON");
    let port = |drive: usize| {
        let address = ready["drives"][drive]["modbus_tcp"].as_str().expect("an address");
        address.rsplit(':').next().expect("a port").to_owned()
    };
    let shape = up.ready.replace(&port(0), "LEFT").replace(&port(1), "RIGHT");
    expect![[r#"
        {"event":"ready","drives":[{"name":"left","model":"SMSD-4.2LAN","modbus_tcp":"127.0.0.1:LEFT"},{"name":"right","model":"SMSD-8.0LAN","modbus_tcp":"0.0.0.0:RIGHT"}]}
    "#]]
    .assert_eq(&shape);
    let mut client = Client::connect(up.address()).expect("reachable");
    assert_eq!(client.read(Reg::HwMajor, 1).expect("answered"), Ok(vec![6]));
    let output = up.end("TERM");
    assert_eq!(text(&output.stdout), "", "nothing else");
}

#[test]
fn sigterm_and_sigint_end_it_with_0() {
    for signal in ["TERM", "INT"] {
        let place = Place::new();
        let up = place.up();
        // With a client in the middle of things.
        let mut client = up.client();
        client.write(Reg::TargetSpeed, &[100, 0, 0, 0, 0x0E]).expect("answered").expect("runs");
        let output = up.end(signal);
        assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), String::new()), "{signal}");
        assert!(client.read(Reg::HwMajor, 1).is_err(), "its connections are closed");
    }
}

/// An SMD3.
const UHV: &str = r#"
[[drive]]
name = "uhv"
model = "SMD3"
serial = "pty"
serial_tcp = "127.0.0.1:0"
[[drive.switch]]
input = "LIMIT_NEGATIVE"
closed = [-40, -30]
"#;

#[test]
fn a_person_is_told_what_runs_where_and_what_to_try() {
    let place = Place::with(&format!("{TWO}{UHV}"));
    let mut up = Up::start(place.command().args(["up", "rig.toml", "--state", "state"]));
    let welcome = up.welcome();
    let port = |after: &str| {
        let at = welcome.find(after).expect("an address") + after.len();
        welcome[at..].split(',').next().expect("a port").to_owned()
    };
    let (left, right) = (port("127.0.0.1:"), port("0.0.0.0:"));
    let lines = port("lines over TCP 127.0.0.1:").lines().next().expect("a port").to_owned();
    expect![[r#"
        stepdrive VERSION: rig.toml is up.

          left  SMSD-4.2LAN  Modbus TCP 127.0.0.1:LEFT, unit 1
                200 steps/rev, travel -50 to 2000.5 full steps, SET_ZERO closed -40 to -30
          right  SMSD-8.0LAN  Modbus TCP 0.0.0.0:RIGHT, unit 1
                 400 steps/rev, endless travel
          uhv  SMD3  serial port FOLDER/state/uhv.tty, lines over TCP 127.0.0.1:LINES
               200 steps/rev, endless travel, LIMIT_NEGATIVE closed -40 to -30

        Non-volatile memory: state

        Things to try from another terminal:
          1. ask it who it is, which needs no password (Debian: apt install mbpoll):
             mbpoll -m tcp -p LEFT -a 1 -0 -1 -t 3:hex -r 0x8001 -c 4 127.0.0.1
          2. log in, find the zero switch, go there and back (pip install pymodbus):
             python3 examples/first_move.py 127.0.0.1 LEFT
          3. talk to the SMD3 as to the real one: MODE,2 then RUNR,1000 then PACT (pip install pyserial):
             python3 -m serial.tools.miniterm --eol CRLF FOLDER/state/uhv.tty 115200
          4. make a rig of your own:
             STEPDRIVE example-rig > my-rig.toml && STEPDRIVE up my-rig.toml

        Ctrl-C ends it.
    "#]]
    .assert_eq(
        &welcome
            .replace(&left, "LEFT")
            .replace(&right, "RIGHT")
            .replace(&lines, "LINES")
            .replace(&shown(&place.path("state")), "FOLDER/state")
            .replace(env!("CARGO_BIN_EXE_stepdrive"), "STEPDRIVE")
            .replace(env!("CARGO_PKG_VERSION"), "VERSION"),
    );
    assert_eq!(text(&up.end("INT").stdout), "");
}

#[test]
fn a_refused_command_is_told_on_stderr() {
    let place = Place::new();
    let up = place.up();
    // A target out of the position's range, written in halves.
    let mut client = up.client();
    client.write(Reg::TargetInput, &[9, 0x14]).expect("answered").expect("accepted");
    assert_eq!(client.read(Reg::CmdError, 1).expect("answered"), Ok(vec![1]));
    let said = text(&up.end("TERM").stderr);
    assert!(said.starts_with("stage: ") && said.lines().count() == 1, "{said}");
}

#[test]
fn a_stderr_that_nobody_reads_holds_up_no_drive() {
    let place = Place::new();
    let up = place.up();
    let mut client = up.client();
    // More notices than a pipe holds.
    for _ in 0..2000 {
        client.write(Reg::TargetInput, &[9, 0x14]).expect("answered").expect("accepted");
        client.set(Reg::Clr, true).expect("answered").expect("accepted");
    }
    assert_eq!(up.end("TERM").status.code(), Some(0));
}

#[test]
fn what_a_client_stored_is_there_when_the_rig_comes_up_again() {
    let place = Place::new();
    let up = place.up();
    up.client().write(Reg::WorkCurrent, &[42]).expect("answered").expect("accepted");
    up.end("TERM");
    let up = place.up();
    assert_eq!(up.client().read(Reg::WorkCurrent, 1).expect("answered"), Ok(vec![42]));
    assert!(shown(&place.memory()).ends_with("state/memory.redb") && place.memory().is_file());
    up.kill();
}
