//! `stepdrive term`, with a terminal and without.

use crate::bench::{Bench, keys};
use crate::rig::Ran;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use serde_json::Value;
use std::fs;
use std::io::{Read as _, Write as _};
use std::os::fd::OwnedFd;
use std::process::Stdio;

/// What it makes of these lines.
fn term(bench: &Bench, words: &str, lines: &str) -> Ran {
    let mut child = bench.command(&format!("term {words}")).stdin(Stdio::piped()).spawn().expect("started");
    // It may have ended already.
    let _ = child.stdin.take().expect("piped").write_all(lines.as_bytes());
    Ran(child.wait_with_output().expect("ended"))
}

fn json(ran: &Ran) -> Vec<Value> {
    ran.stdout().lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

#[test]
fn lines_to_an_smd3_are_sent_as_typed_and_replies_explained() {
    let bench = Bench::start();
    let ran = term(&bench, "-a uhv", "vmax , 500\n\n# a remark\nMODE\nLP+\n");
    assert_eq!(
        ran.done(),
        "0x0040,0x0000,5.00000E+02\n    VMAX = 500 Hz\n    status: STANDBY; no errors\n\
         0x0040,0x0000,2 (Remote)\n    MODE = 2, Remote\n    status: STANDBY; no errors\n\
         0x0040,0x0000,0\n    LP+ = 0, active high\n    status: STANDBY; no errors\n"
    );
}

#[test]
fn what_an_smd3_refuses_is_told_in_words_and_sets_the_exit_code() {
    let bench = Bench::start();
    let ran = term(&bench, "-a uhv", "FOO\nVMAX,fast\nESTOP\nRUNR,10\nexit\nSER\n");
    assert_eq!(ran.code(), 1, "{}", ran.stderr());
    for part in [
        "0x0040,0x0000,-4 (Unknown command)\n    FOO refused (-4, Unknown command): there is no such command\n",
        "VMAX,fast refused (-101, Argument type): VMAX takes a number\n",
        "ERRORS: EMERGENCY STOP (CLR clears what is over)\n",
        "the motor is disabled by EMERGENCY STOP; remove the cause and clear it with CLR\n",
    ] {
        assert!(ran.stdout().contains(part), "{part}\n{}", ran.stdout());
    }
    // `exit` ends it, before SER.
    assert!(ran.stdout().trim_end().ends_with("(CLR clears what is over)"), "{}", ran.stdout());
    assert_eq!(term(&bench, "-a uhv", "RUNR,10\n").code(), 8);
}

#[test]
fn an_smd3_is_scripted_with_json() {
    let bench = Bench::start();
    let ran = term(&bench, "-a uhv --json", "IR,0.7\nFLAGS\nNO\n");
    let told = json(&ran);
    assert_eq!(
        keys(&told[0]),
        ["command", "error", "error_flags", "meaning", "reply", "sent", "status_flags", "unit", "value"]
    );
    assert_eq!(
        (&told[0]["sent"], &told[0]["value"], &told[0]["unit"]),
        (&"IR,0.7".into(), &0.6875.into(), &"A".into())
    );
    assert_eq!(told[1]["status_flags"], serde_json::json!(["STANDBY"]));
    assert!(told[1]["reply"].as_str().is_some_and(|text| text.contains("TSHORT\t0\n")), "{}", told[1]);
    assert!(told[2]["error"].as_str().is_some_and(|text| text.contains("no such command")), "{}", told[2]);
}

#[test]
fn an_smsd_is_spoken_to_by_the_names_of_its_registers_and_commands() {
    let bench = Bench::start();
    let ran = term(&bench, "-a stage", "MAX_SPEED=800\nmicrostepping\nMask\nSoft STOP\nIP 0\nGO_ZERO\n");
    let lines: Vec<&str> = ran.done().lines().collect();
    assert_eq!(
        lines[..3],
        ["MAX_SPEED = 800 full steps/s", "MICROSTEPPING = 0x0004  (1/16)", "Mask = 0x00FF  (all)"]
    );
    assert!(
        lines[3].starts_with("Soft STOP: the motor stands, energised, position 0 microsteps"),
        "{}",
        lines[3]
    );
    assert_eq!(lines[4], "IP 0 = 192");
    assert!(lines[5].starts_with("GO_ZERO: the motor stands"), "{}", lines[5]);
}

#[test]
fn what_an_smsd_does_not_take_is_told_in_words() {
    let bench = Bench::start();
    bench.energise();
    let ran = term(&bench, "-a stage", "MICROSTEPPING=3\nMAX_SPEED=5\nMAX_SPED\nRUN_F\nPassword_LOW32\n");
    assert_eq!(ran.code(), 7, "{}", ran.stdout());
    let lines: Vec<&str> = ran.stdout().lines().collect();
    assert!(lines[0].contains("de-energise it first"), "{}", lines[0]);
    assert_eq!(lines[1], "MAX_SPEED 5 is out of range: 16 to 15600 full steps/s; nothing was sent");
    assert_eq!(
        lines[2],
        "`MAX_SPED` is no register and no command; did you mean MAX_SPEED?; nothing was sent"
    );
    assert!(lines[3].starts_with("RUN_F") && lines[3].ends_with("nothing was sent"), "{}", lines[3]);
    assert!(lines[4].starts_with("Password_LOW32 cannot be read"), "{}", lines[4]);
}

#[test]
fn an_smsd_is_scripted_with_json() {
    let bench = Bench::start();
    bench.energise();
    let ran = term(&bench, "-a stage --json", "ABS_POS\nRUN_F 100\nHard STOP\nACC=x\n");
    assert_eq!(ran.code(), 1);
    let told = json(&ran);
    assert_eq!(keys(&told[0]), ["address", "line", "meaning", "name", "unit", "value"]);
    assert_eq!((&told[1]["command"], &told[1]["moving"]), (&"RUN_F".into(), &true.into()));
    assert_eq!(told[2]["moving"], false);
    assert_eq!(keys(&told[3]), ["error", "line"]);
}

#[test]
fn help_needs_no_controller() {
    let bench = Bench::start();
    let ran = term(&bench, "-a 127.0.0.1:1", "help MAX_SPEED\nhelp\n");
    assert!(
        ran.done().starts_with("MAX_SPEED, holding register 0x1101\n    Highest speed.\n"),
        "{}",
        ran.stdout()
    );
    let ran = term(&bench, "-a smd3+tcp://127.0.0.1:1", "help vmax\n");
    assert!(
        ran.done().starts_with("VMAX[,FLOAT]\n    Target speed.\n    takes 0 to 15000 Hz"),
        "{}",
        ran.stdout()
    );
}

#[test]
fn trouble_on_the_line_ends_it() {
    let bench = Bench::start();
    for target in ["127.0.0.1:1", "smd3+tcp://127.0.0.1:1"] {
        let ran = term(&bench, &format!("-a {target} --connect-timeout 200ms"), "SPEED\nSPEED\n");
        assert_eq!((ran.code(), ran.stdout()), (5, ""), "{}", ran.stderr());
        assert!(ran.stderr().contains("cannot connect to 127.0.0.1:1"), "{}", ran.stderr());
    }
}

/// A terminal: the end that a person has, and that which a program has.
fn terminal() -> (fs::File, OwnedFd) {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).expect("a terminal");
    grantpt(&master).expect("granted");
    unlockpt(&master).expect("unlocked");
    let name = ptsname(&master, Vec::new()).expect("named");
    let slave = fs::File::options().read(true).write(true).open(name.to_str().expect("text")).expect("there");
    (fs::File::from(master), slave.into())
}

/// Reads until this has come, and behind it the prompt for the next line.
fn read_until(from: &mut fs::File, wanted: &str) {
    let mut seen = Vec::new();
    loop {
        let text = String::from_utf8_lossy(&seen).into_owned();
        if text.split_once(wanted).is_some_and(|(_, behind)| behind.contains("> ")) {
            return;
        }
        let mut bytes = [0; 1024];
        let count = from.read(&mut bytes).expect("it has not ended");
        seen.extend_from_slice(&bytes[..count]);
    }
}

#[test]
fn at_a_terminal_lines_can_be_called_back_and_refusals_are_no_failure() {
    let bench = Bench::start();
    let (mut person, slave) = terminal();
    let other = slave.try_clone().expect("another");
    let mut command = bench.command("term -a uhv");
    command.env("TERM", "xterm").stdin(slave).stdout(other).stderr(Stdio::piped());
    let child = command.spawn().expect("started");
    drop(command);
    read_until(&mut person, "");
    person.write_all(b"VMAXX\x7f\r").expect("typed");
    read_until(&mut person, "VMAX = 1000 Hz");
    // Cursor up.
    person.write_all(b"\x1b[A\r").expect("typed");
    read_until(&mut person, "VMAX = 1000 Hz");
    person.write_all(b"FOO\r").expect("typed");
    read_until(&mut person, "there is no such command");
    person.write_all(b"exit\r").expect("typed");
    let ran = Ran(child.wait_with_output().expect("ended"));
    assert_eq!(ran.code(), 0, "{}", ran.stderr());
    assert_eq!(
        ran.stderr(),
        "uhv: lines are sent as they are typed; `help` explains, `exit` or Ctrl-D ends\n"
    );
}
