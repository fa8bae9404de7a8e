//! The standard protocol beside Modbus, recorded and replayed.

use crate::bench::{Bench, Client, read, replay_it, replayed, trigger, write};
use std::net::TcpListener;
use std::time::Duration;
use stepdrive_rig::file::ClockMode;
use stepdrive_server::Until;
use stepdrive_server::replay::Replayed;
use stepdrive_spec::smsd::registers::Reg;

/// One drive of each firmware.
const RIG: &str = r#"
    [rig]
    clock = "x20"
    seed = 9
    [[drive]]
    name = "stage"
    model = "SMSD-4.2LAN"
    modbus_tcp = "127.0.0.1:0"
    usb_tcp = "127.0.0.1:0"
    [drive.mechanics]
    travel = [-300.0, 300.0]
    [[drive]]
    name = "table"
    model = "SMSD-8.0LAN"
    lan = "standard"
    standard_tcp = "127.0.0.1:0"
    [[wire]]
    from = "stage.relay"
    to = "table.IN0"
"#;

/// Half packets are dropped after 400 ms.
const SILENCE: Duration = Duration::from_millis(600);

const PASSWORD: [u8; 8] = [0xEF, 0xCD, 0xAB, 0x89, 0x67, 0x45, 0x23, 0x01];

/// The bytes of a packet as they go over LAN.
fn raw(packet_type: u8, id: u8, data: &[u8]) -> Vec<u8> {
    let [low, high] = u16::try_from(data.len()).expect("not so long").to_le_bytes();
    let mut bytes = [&[0, 2, packet_type, id, low, high], data].concat();
    bytes[0] = bytes.iter().fold(0_u8, |sum, byte| sum.wrapping_sub(*byte));
    bytes
}

/// The same as they go over USB.
fn stuffed(packet_type: u8, id: u8, data: &[u8]) -> Vec<u8> {
    let escaped = raw(packet_type, id, data).into_iter().flat_map(|byte| match byte {
        0xFA | 0xFB | 0xFE => vec![0xFE, byte ^ 0x80],
        _ => vec![byte],
    });
    [0xFA].into_iter().chain(escaped).chain([0xFB]).collect()
}

fn instruction(opcode: u8, data: i32) -> [u8; 4] {
    (data.cast_unsigned() << 10 | u32::from(opcode) << 4).to_le_bytes()
}

/// Instructions that move, read, switch the relay, run a program, and are refused.
const INSTRUCTIONS: [(u8, i32); 10] = [
    (0x06, 600),
    (0x0E, 400),
    (0x0B, 0),
    (0x24, 0),
    (0x10, -5),
    (0x1F, 0),
    (0x30, 0),
    (0x25, 0),
    (0x38, 0),
    (0x06, 1),
];

type Pack = fn(u8, u8, &[u8]) -> Vec<u8>;

async fn say_all(client: &mut Client, pack: Pack, id: u8) {
    let program: Vec<u8> = [(0x24, 0), (0x10, 200), (0x25, 0), (0x29, 0x100)]
        .into_iter()
        .flat_map(|(opcode, data)| instruction(opcode, data))
        .collect();
    client.tell(&pack(0, id, &PASSWORD)).await;
    client.tell(&pack(4, id, &program)).await;
    for (opcode, data) in INSTRUCTIONS {
        client.tell(&pack(2, id, &instruction(opcode, data))).await;
    }
    for packet_type in [8, 12, 14, 15, 16] {
        client.tell(&pack(packet_type, id, &[])).await;
    }
}

async fn usb_session(bench: &Bench) {
    let port = bench.server.drives()[0].usb_tcp.expect("it has USB").port();
    for id in 0..4 {
        let mut client = bench.smsd_at(port).await;
        say_all(&mut client, stuffed, id).await;
        client.tell(b"noise\xFA\x01\xFA\xFBmore\xFA\x02\x02\xFE\xFB\xFB").await;
        client.tell(&[&[0xFA][..], &[1; 1500], b"\xFB"].concat()).await;
        // Two at once, and the start of a third.
        let many = [stuffed(14, 8, &[]), stuffed(2, 9, &instruction(0x0B, 0)), b"\xFA\x11".to_vec()].concat();
        client.tell(&many).await;
        if id == 1 {
            tokio::time::sleep(SILENCE).await;
        }
        client.tell(&stuffed(14, 10, &[])).await;
    }
}

async fn standard_session(bench: &Bench) {
    let port = bench.server.drives()[1].standard_tcp.expect("the standard firmware").port();
    for id in 0..4 {
        let mut client = bench.smsd_at(port).await;
        say_all(&mut client, raw, id).await;
        client.tell(&raw(14, 8, &[])[..5]).await;
        tokio::time::sleep(SILENCE).await;
        client.tell(&raw(14, 8, &[])).await;
        client.tell(b"\x01\x02\x03\x04\xFF\xFF and what comes behind").await;
    }
}

async fn modbus_session(bench: &Bench) {
    for round in 0..4 {
        let mut client = bench.smsd(0).await;
        client.log_in().await;
        for request in [
            write(Reg::MaxSpeed, &[100 + round]),
            read(Reg::AbsPos, 2),
            trigger(Reg::Relay),
            write(Reg::WorkCurrent, &[10 + round]),
            read(Reg::MaxSpeed, 1),
        ] {
            let frame = client.frame(1, &request);
            client.tell(&frame).await;
        }
    }
}

const ACTIONS: [&str; 10] = [
    "fault stage.reply-damage 30%",
    "fault table.reply-drop 30%",
    "fault stage.reply-id 40%",
    "fault stage.rotor blocked for 300ms",
    "fault table.reply-pieces 3 1ms",
    "power stage off for 100ms",
    "fault table.connection silent for 200ms",
    "power table off for 100ms",
    "fault stage.temperature high for 200ms",
    "fault stage.connection cut for 50ms",
];

async fn act(bench: &Bench) {
    for action in ACTIONS {
        tokio::time::sleep(Duration::from_millis(200)).await;
        bench.act(action);
    }
}

fn count(recording: &str, what: &str) -> usize {
    recording.lines().filter(|line| line.contains(what)).count()
}

fn identical(recording: &str) -> Replayed {
    let replayed = replay_it(recording);
    assert!(replayed.identical && !replayed.cut_short, "{replayed}\n{recording}");
    replayed
}

#[tokio::test]
async fn modbus_usb_and_the_standard_firmware_mixed_replay_to_one_digest() {
    let bench = Bench::start(RIG).await;
    // The second after power-up.
    bench.server.control().run(&Until::Time, Duration::from_secs(2)).await.expect("nothing is played");
    bench.server.control().set_clock(ClockMode::Factor(20.0));
    tokio::join!(usb_session(&bench), standard_session(&bench), modbus_session(&bench), act(&bench));
    let recording = bench.stop().await;
    let replayed = identical(&recording);
    assert!(replayed.requests > 150, "{replayed}");
    // A client that comes during one of the outages, two of the stage and one of the table, is none.
    for (what, least) in [
        (r#""via":"usb""#, 2),
        (r#""via":"standard""#, 3),
        ("greeted", 3),
        ("ERROR_TIME_OUT", 3),
        ("\"open\"", 9),
    ] {
        assert!(count(&recording, what) >= least, "{what}: {}", count(&recording, what));
    }
    assert!((0..20).all(|_| replay_it(&recording).digest == replayed.digest));
}

/// A short recording over USB.
async fn short() -> String {
    let bench = Bench::start(RIG).await;
    bench.server.control().run(&Until::Time, Duration::from_secs(2)).await.expect("nothing is played");
    let mut client = bench.smsd_at(bench.server.drives()[0].usb_tcp.expect("it has USB").port()).await;
    client.tell(&stuffed(0, 1, &PASSWORD)).await;
    client.tell(&stuffed(2, 2, &instruction(0x06, 600))).await;
    bench.stop().await
}

#[tokio::test]
async fn network_parameters_set_over_usb_replay() {
    let bench = Bench::start(RIG).await;
    bench.server.control().run(&Until::Time, Duration::from_secs(2)).await.expect("nothing is played");
    let mut client = bench.smsd_at(bench.server.drives()[0].usb_tcp.expect("it has USB").port()).await;
    let port = TcpListener::bind("127.0.0.1:0").expect("a free port").local_addr().expect("bound").port();
    client.tell(&stuffed(0, 1, &PASSWORD)).await;
    let mut lan = [[1; 16].as_slice(), &[0; 6]].concat();
    lan.extend(port.to_le_bytes());
    lan.extend([1, 9]);
    client.tell(&stuffed(11, 2, &lan)).await;
    client.tell(&stuffed(12, 3, &[])).await;
    let mut modbus = bench.smsd_at(port).await;
    let frame = modbus.frame(9, &read(Reg::HwMajor, 2));
    assert!(!modbus.tell(&frame).await.is_empty());
    identical(&bench.stop().await);
}

#[tokio::test]
async fn a_difference_is_told_in_words() {
    let recording = short().await;
    identical(&recording);
    let changed: String = recording
        .split_inclusive('\n')
        .map(|line| {
            if line.contains("heard") { line.replace("\"tx\":\"fa", "\"tx\":\"fb") } else { line.to_owned() }
        })
        .collect();
    let replayed = replay_it(changed);
    assert_eq!(replayed.differences, 2);
    let text = replayed.to_string();
    assert!(text.contains("stage: CODE_CMD_REQUEST\n"), "{text}");
    assert!(text.contains("OK_ACCESS, status 13, data 0"), "{text}");
    assert!(!text.contains("89ABCDEF"), "{text}");
}

#[tokio::test]
async fn what_cannot_have_happened_is_refused() {
    let recording = short().await;
    let told = |from: &str, to: &str| {
        assert!(recording.contains(from), "{from}");
        replayed(recording.replace(from, to)).map(drop).expect_err(to).to_string()
    };
    let impossible = "cannot be reached in this way";
    assert!(told(r#""via":"usb""#, r#""via":"standard""#).contains(impossible));
    assert!(told(r#""drive":0,"via":"usb""#, r#""drive":1"#).contains(impossible));
    assert!(told(r#""via":"usb""#, r#""via":"radio""#).contains("unknown variant `radio`"));
    // The same with an entry behind the first request.
    let with = |what: &str| {
        let heard = recording.lines().find(|line| line.contains("heard")).expect("a request");
        let (t, _) = heard.split_once(",\"heard").expect("an entry");
        replayed(recording.replacen(heard, &format!("{heard}\n{t},{what}}}"), 1)).map(drop)
    };
    let refused = |what: &str| with(what).expect_err(what).to_string();
    assert_eq!(
        with(r#""counted":{"drive":0,"counter":"ERROR_FRAM"}"#).map_err(|error| error.to_string()),
        Ok(())
    );
    let told = refused(r#""counted":{"drive":0,"counter":"ERROR_X"}"#);
    assert!(told.contains("there is no counter ERROR_X"), "{told}");
    let told = refused(r#""counted":{"drive":7,"counter":"ERROR_FRAM"}"#);
    assert!(told.contains("the rig has no drive 7"), "{told}");
    let told = refused(r#""greeted":{"conn":1}"#);
    assert!(told.contains("the drive does not speak first"), "{told}");
}
