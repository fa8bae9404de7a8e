//! A session with everything in it: both families, several clients at a time, faults, wires, power, time.

use crate::bench::{Bench, Client, read, trigger, write};
use std::sync::OnceLock;
use std::time::Duration;
use stepdrive_rig::file::ClockMode;
use stepdrive_server::Until;
use stepdrive_spec::modbus::Request;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::registers::Reg;

/// Two SMSDs joined by a wire, one of them with switches, and an SMD3 that gets warm.
pub(crate) const RIG: &str = r#"
    [rig]
    clock = "x20"
    seed = 77
    [[drive]]
    name = "left"
    model = "SMSD-4.2LAN"
    modbus_tcp = "127.0.0.1:0"
    [drive.mechanics]
    travel = [-300.0, 300.0]
    [[drive.switch]]
    input = "SET_ZERO"
    closed = [-120.0, -100.0]
    [[drive.switch]]
    input = "IN1"
    closed = [20.0, 30.0]
    [[drive]]
    name = "right"
    model = "SMSD-8.0LAN"
    modbus_tcp = "127.0.0.1:0"
    autonomous = true
    [[drive]]
    name = "uhv"
    model = "SMD3"
    serial_tcp = "127.0.0.1:0"
    [drive.mechanics]
    travel = [-500.0, 500.0]
    [[drive.switch]]
    input = "LIMIT_POSITIVE"
    closed = [150.0, 500.0]
    [drive.winding]
    time_constant = 2.0
    [[wire]]
    from = "left.relay"
    to = "right.CONTINUE"
    delay = "1.5ms"
    [[wire]]
    from = "right.relay"
    to = "left.IN0"
"#;

/// What is done to the rig meanwhile. All of it at once is more than any client would bear.
const ACTIONS: &[&str] = &[
    "input left.IN0 1",
    "fault left.IN1 bounce",
    "fault left.reply-damage 30%",
    "fault left.reply-duplicate 20%",
    "fault right.reply-drop 40%",
    "fault right.reply-id 30%",
    "fault right.exception 06 50% for 1s",
    "fault uhv.reply-pieces 3 1ms",
    "fault uhv.reply-damage 20%",
    "fault uhv.reply-delay 2ms 1ms",
    "fault left.rotor blocked for 300ms",
    "input left.IN0 release",
    "input left.STEP pulse 5ms x20 every 11ms",
    "wire left.relay right.CONTINUE cut",
    "fault uhv.thermocouple open for 100ms",
    "fault left.connection silent for 500ms",
    "input uhv.JOYSTICK 1",
    "input uhv.JOYSTICK_CW pulse 700ms",
    "wire left.relay right.CONTINUE mend",
    "fault left.motor short for 50ms",
    "fault uhv.flash worn for 2s",
    "panel right bF 2",
    "power right off for 300ms",
    "input uhv.JOYSTICK release",
    "fault left.temperature high for 200ms",
    "fault uhv.connection cut for 100ms",
    "power uhv off for 400ms",
];

/// A recording of the session, made once.
pub(crate) fn recorded() -> &'static str {
    static SESSION: OnceLock<String> = OnceLock::new();
    SESSION.get_or_init(|| {
        // The test that asks first may have a runtime of its own on this thread.
        std::thread::scope(|scope| scope.spawn(record).join().expect("a session"))
    })
}

fn record() -> String {
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .expect("a runtime")
        .block_on(async {
            let bench = Bench::start(RIG).await;
            let clients = async {
                tokio::join!(
                    smsd_session(&bench, 0, 1),
                    smsd_session(&bench, 0, 2),
                    smsd_session(&bench, 1, 3),
                    smd3_session(&bench, "VMAX,400|RUNV,+|PACT|IA,0.6|VACT|"),
                    smd3_session(&bench, "TMOT|BAKET,60|STOP|STORE|RUNV,-|LOAD|FLAGS|"),
                )
            };
            tokio::join!(clients, act(&bench));
            bench.stop().await
        })
}

async fn act(bench: &Bench) {
    let control = bench.server.control();
    let modes = [ClockMode::Real, ClockMode::Factor(300.0), ClockMode::Paused, ClockMode::Factor(20.0)];
    for (number, action) in ACTIONS.iter().enumerate() {
        bench.act(action);
        tokio::time::sleep(Duration::from_millis(12)).await;
        match number % 4 {
            0 => control.set_clock(modes[number / 4 % modes.len()]),
            2 => drop(control.run(&Until::Idle, Duration::from_millis(20)).await),
            _ => {}
        }
    }
    control.set_clock(ClockMode::Factor(20.0));
}

/// Commands, reads, what is refused, what is for another unit, what comes in pieces and many at once.
async fn smsd_session(bench: &Bench, drive: usize, salt: u16) {
    for visit in 0..4 {
        let mut client = bench.smsd(drive).await;
        client.log_in().await;
        for round in 0..6_u16 {
            for request in requests(salt + visit, round) {
                let frame = client.frame(1, &request);
                client.tell(&frame).await;
            }
            tell_awkwardly(&mut client).await;
        }
    }
}

fn requests(salt: u16, round: u16) -> Vec<Request> {
    const CODES: [Opcode; 12] = [
        Opcode::RunF,
        Opcode::StartProgramMem0,
        Opcode::MoveF,
        Opcode::SoftStop,
        Opcode::GoToR,
        Opcode::GoUntilF,
        Opcode::StartProgramMem1,
        Opcode::ScanZeroR,
        Opcode::ScanMarkF,
        Opcode::GoZero,
        Opcode::HardHiZ,
        Opcode::StopProgramMem,
    ];
    let code = CODES[usize::from(salt * 5 + round) % CODES.len()];
    let program = program(salt);
    let lines = u16::try_from(program.len()).expect("few");
    let bytes: Vec<u8> = program.iter().flat_map(|word| word.to_le_bytes()).collect();
    let halves: Vec<u16> = bytes.as_chunks().0.iter().map(|half| u16::from_le_bytes(*half)).collect();
    vec![
        read(Reg::AbsPos, 2),
        write(Reg::NProg, &[round % 2, 0, lines, 0, [2, 1][usize::from(round > 0)]]),
        write(Reg::TargetSpeed, &[100 + 37 * salt, 200 * round, 0, 0, code.code().into()]),
        trigger(Reg::Relay),
        write(Reg::CmdBuffer, &halves),
        write(Reg::NProg, &[round % 2, 0, lines, 0, 1]),
        read(Reg::HwMajor, 4),
        write(Reg::NProg, &[round % 2, 0, 1, lines, 4]),
        read(Reg::Speed, 1),
    ]
}

/// A program that moves to and fro, switches the relay and waits for the other's.
fn program(salt: u16) -> [u32; 7] {
    [
        (Opcode::SetRele, 0),
        (Opcode::MoveF, 20 * i32::from(salt)),
        (Opcode::SetWait, 3),
        (Opcode::ClrRele, 0),
        (Opcode::MoveR, 700),
        (Opcode::WaitContinue, 0),
        (Opcode::GotoProgram, 0),
    ]
    .map(|(opcode, position)| Instruction::with_position(opcode, position).word())
}

async fn tell_awkwardly(client: &mut Client) {
    let foreign = client.frame(99, &read(Reg::HwMajor, 1));
    client.tell(&foreign).await;
    client.tell(&[0, 9, 0, 0, 0, 3, 1, 0x2B, 0]).await;
    client.send(&[0, 9, 0, 1, 0, 3, 1, 0x2B, 0]).await;
    let many = [client.frame(1, &read(Reg::AbsPos, 2)), client.frame(0, &read(Reg::HwMajor, 1))].concat();
    let (first, rest) = many.split_at(15);
    client.send(first).await;
    tokio::time::sleep(Duration::from_millis(3)).await;
    client.tell(rest).await;
}

/// Lines of every sort, cut anywhere.
async fn smd3_session(bench: &Bench, lines: &str) {
    for visit in 0..5 {
        let mut client = bench.smd3(2).await;
        for end in ["\r\n", "\r", "\n"] {
            let said = lines.replace('|', end);
            for piece in said.as_bytes().chunks(3 + visit) {
                client.tell(piece).await;
            }
        }
        client.tell(&[b'x'; 300]).await;
        client.tell(b"\r\n\r\n\xFF\xFE\rVMAX,\n").await;
        client.send(b"SLEEP").await;
    }
}
