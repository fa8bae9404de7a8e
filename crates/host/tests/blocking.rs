//! The drivers without asynchronous code: against a drive that a thread serves over TCP.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::time::{Duration, Instant as Clock};
use stepdrive_drive::smd3::{Config, Smd3, Stored};
use stepdrive_host::axis::{Axis, AxisOptions, DriveAxis, MoveOptions, Smd3Motor, Stop, open};
use stepdrive_host::blocking::Blocking;
use stepdrive_host::smd3::Smd3Client;
use stepdrive_host::units::{Amount, Goal};
use stepdrive_host::uri::Target;
use stepdrive_host::{Direction, Error, Timeouts};
use stepdrive_proto::smd3::{LineBuf, LineReader, encode_reply};
use stepdrive_spec::smd3::commands::Command;
use stepdrive_spec::time::Instant;

/// Serves one client after another for as long as the test runs; answers the port.
fn serve() -> Target {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let port = listener.local_addr().expect("bound").port();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            talk(stream.expect("a client"));
        }
    });
    Target::Smd3Tcp { host: "127.0.0.1".to_owned(), port }
}

#[allow(clippy::disallowed_methods, reason = "a drive in real time, for a runtime that cannot be paused")]
fn talk(mut stream: TcpStream) {
    let mut drive = Smd3::power_up(Instant::ZERO, Config::default(), Stored::Nothing, 0);
    let began = Clock::now();
    let (mut reader, mut chunk, mut out) = (LineReader::new(), [0; 64], LineBuf::new());
    while let Ok(count @ 1..) = stream.read(&mut chunk) {
        let mut bytes = &chunk[..count];
        while let Some(line) = reader.take(&mut bytes) {
            let reply = drive.handle(Instant::ZERO + began.elapsed(), line.decode());
            encode_reply(&mut out, &reply);
            if stream.write_all(&out).is_err() {
                return;
            }
        }
    }
}

fn axis(target: &Target) -> DriveAxis<Smd3Motor> {
    DriveAxis::new(Smd3Motor::new(Smd3Client::new(target.connect(), Timeouts::default())))
}

#[test]
fn an_axis_is_moved_without_asynchronous_code() {
    let axis = Blocking::new(axis(&serve())).expect("a runtime");
    axis.zero().expect("it stands");
    let plan =
        axis.plan(Goal::parse("to 20 steps").expect("a goal"), MoveOptions::default()).expect("possible");
    assert_eq!(plan.sent, ["RUNA,20"]);
    let twenty = Amount::parse("20 steps").expect("an amount");
    axis.move_to(twenty, MoveOptions::default()).expect("it is there");
    assert_eq!(axis.position(), Ok(twenty));
    axis.run_off(Direction::Negative, MoveOptions::default()).expect("started");
    axis.stop(Stop::Soft).expect("stopped");
    let state = axis.wait_done(Some(Duration::from_secs(5))).expect("it stands");
    assert_eq!(axis.state(), Ok(state));
    assert_eq!((axis.clear_faults(), axis.get().name()), (Ok(vec![]), axis.get().motor().client().name()));
    assert!(
        matches!(axis.home(Direction::Negative, MoveOptions::default()), Err(Error::Refused(_))),
        "L is 0"
    );
}

#[test]
fn a_client_is_called_without_asynchronous_code() {
    let client = Smd3Client::new(serve().connect(), Timeouts::default());
    let drive = Blocking::new(client).expect("a runtime");
    assert_eq!(drive.run(|drive| drive.get_number(Command::Vmax)), Ok(1000.0));
    assert_eq!(drive.run(|drive| drive.get_number(Command::Tzw)), Ok(0.0));
}

#[tokio::test]
async fn inside_an_asynchronous_task_a_blocking_call_is_refused() {
    let drive = Blocking::new(Smd3Client::new(serve().connect(), Timeouts::default())).expect("a runtime");
    assert!(matches!(drive.run(Smd3Client::mode), Err(Error::Usage(_))));
    // And dropping it there does no harm.
    drop(drive);
}

#[tokio::test]
async fn an_axis_is_opened_by_its_target() {
    let target = serve();
    let axis = open(&target, &AxisOptions::default());
    assert_eq!(axis.name(), target.name());
    axis.move_by(Amount::parse("-5 steps").expect("an amount"), MoveOptions::default())
        .await
        .expect("it is there");
    assert_eq!(axis.position().await.map(|position| position.to_string()), Ok("-5 steps".to_owned()));
    let nobody = open(&Target::parse("smsd+tcp://127.0.0.1:9").expect("a target"), &AxisOptions::default());
    assert_eq!(nobody.state().await.expect_err("nothing listens there").exit_code(), 5);
}
