//! What stands between a person and a rig: there is none, another thing answers, a token is missing.

use crate::bench::{Bench, Ran};
use crate::up::{ONE, Place};
use std::fs;
use std::io::{Read, Write};
use std::net::TcpListener;
use std::thread;

/// Runs `stepdrive rig` with these words where no rig was brought up.
fn alone(place: &Place, words: &str) -> Ran {
    Ran(place.run(&format!("rig {words}")))
}

#[test]
fn a_rig_that_is_not_there_is_exit_code_2_and_how_to_start_one() {
    let place = Place::new();
    fs::write(place.path("s.toml"), "[[step]]\nexpect = \"stage.READY\"\n").expect("written");
    // A port that was free a moment ago.
    let address = TcpListener::bind("127.0.0.1:0").and_then(|port| port.local_addr()).expect("a free port");
    let expected = format!(
        "no rig answers at http://{address} (connection refused): start one with `stepdrive up`, or name its API with \
         --api URL"
    );
    for words in ["status", "clock", "clock real", "input a.IN0 1", "fault", "wire", "watch", "play s.toml"] {
        assert_eq!(alone(&place, &format!("{words} --api {address}")).refused(2), expected, "{words}");
    }
}

#[test]
fn a_host_that_does_not_exist_is_exit_code_2() {
    let said = alone(&Place::new(), "status --api http://no-such-host.invalid:1").refused(2);
    assert!(said.starts_with("no rig answers at http://no-such-host.invalid:1 ("), "{said}");
}

#[test]
fn a_proxy_in_the_environment_is_not_asked() {
    let bench = Bench::start();
    let mut command = bench.command();
    for name in ["http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"] {
        command.env(name, "http://127.0.0.1:9");
    }
    Ran(command.arg("status").output().expect("started")).done();
}

/// Answers one connection with this, and says where.
fn something_else(answer: &'static str) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = listener.local_addr().expect("bound");
    thread::spawn(move || {
        let (mut stream, _) = listener.accept()?;
        let asked = stream.read(&mut [0; 1024])?;
        assert_ne!(asked, 0, "a request comes first");
        stream.write_all(answer.as_bytes())
    });
    address.to_string()
}

#[test]
fn something_else_that_answers_is_told_from_a_rig() {
    let page = "HTTP/1.1 200 OK\r\ncontent-type: text/html\r\ncontent-length: 6\r\n\r\n<html>";
    let missing = "HTTP/1.1 404 Not Found\r\ncontent-length: 0\r\n\r\n";
    for answer in [page, missing, "SSH-2.0-OpenSSH_9.2\r\n\r\n"] {
        let address = something_else(answer);
        let said = alone(&Place::new(), &format!("status --api {address}")).refused(2);
        assert!(said.starts_with(&format!("what answers at http://{address} is not a rig (")), "{said}");
    }
    let address = something_else("");
    let said = alone(&Place::new(), &format!("status --api {address}")).refused(2);
    assert!(said.contains("closed without an answer"), "{said}");
}

#[test]
fn words_that_are_no_command_are_exit_code_1() {
    let place = Place::new();
    for (words, part) in [
        ("", "Usage: stepdrive rig"),
        ("statsu", "'status'"),
        ("input a.IN0", "<SIGNAL>"),
        ("fault u.thermocouple", "<SETTING>"),
        ("wire a.relay", "<TO>"),
        ("power a", "<ON|OFF>"),
        ("do", "<ACTION>"),
        ("play", "<FILE>"),
        ("play s.toml --rig r.toml", "--headless"),
        ("status --token a --token-file b", "cannot be used with"),
        ("status --api https://127.0.0.1:1", "over http"),
        ("status --api http://127.0.0.1:1/v1", "host and port"),
        ("status --token-file nowhere", "cannot read the token file nowhere"),
        ("status --token-file rig.toml", "printable ASCII"),
    ] {
        let ran = alone(&place, words);
        assert_eq!((ran.code(), ran.stdout()), (1, ""), "{words}");
        assert!(ran.stderr().contains(part), "{words}: {}", ran.stderr());
    }
}

const TOKEN: &str = "correct-horse-battery-staple";

#[test]
fn a_token_lets_one_in_and_nothing_else_does() {
    let bench = Bench::with(&format!("[rig]\napi = \"127.0.0.1:0\"\napi_token = \"{TOKEN}\"\n{ONE}"));
    let said = bench.rig("status").refused(1);
    assert!(said.contains("a token is needed") && said.contains("--token-file FILE"), "{said}");
    let said = bench.rig("status --token wrong-horse-battery-staple").refused(1);
    assert!(said.contains("this is not the token"), "{said}");
    for words in ["clock real", "input stage.IN0 1", "watch"] {
        bench.rig(words).refused(1);
    }
    bench.rig(&format!("status --token {TOKEN}")).done();
    fs::write(bench.place.path("token"), format!("{TOKEN}\n")).expect("written");
    bench.rig("--token-file token status").done();
    bench.rig("input stage.IN0 1 --token-file token").done();
}

#[test]
fn help_has_examples_for_every_command() {
    let place = Place::new();
    for command in ["status", "clock", "input", "fault", "wire", "power", "panel", "do", "play", "watch"] {
        let ran = alone(&place, &format!("{command} --help"));
        let help = ran.done();
        assert!(help.contains(&format!("\n  stepdrive rig {command}")), "{help}");
        assert!(help.contains("--api <URL>") && help.contains("--json"), "{help}");
    }
}
