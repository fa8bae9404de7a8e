//! What eight hours of a mixed rig take without its server, on virtual time: programs, a bake, moves by lines.
//!
//! Two SMSDs keep each other in step by their relays and two run a shuttle; of three SMD3s one bakes and is asked for its
//! temperature every minute, one goes to and fro by a line every ten seconds, one is idle. The ways in which time passes
//! are taken in turn, in rounds, so that whatever else the machine does falls on all of them:
//!
//! * headless: from one line to the next;
//! * watched: the same, with a look at a quantity that flows, for a condition that never comes;
//! * in pieces: 10 ms at a time, as often as a server that keeps step with the clock on the wall could.
//!
//! Prints a table, and what each group of the rig takes by itself.

use std::time::{Duration, Instant as Wall};
use stepdrive_bench::median;
use stepdrive_bench::programs::{SHUTTLE, words};
use stepdrive_drive::smd3::Stored;
use stepdrive_drive::smsd::Memory;
use stepdrive_proto::smd3::decode_line;
use stepdrive_rig::any::AnyMachine;
use stepdrive_rig::condition::Condition;
use stepdrive_rig::course::{self, Arrival, Goal};
use stepdrive_rig::file::{ControllerSection, DriveSection, RigFile};
use stepdrive_rig::group::Group;
use stepdrive_spec::time::Instant;

/// Odd, so that there is a median.
const ROUNDS: usize = 9;
/// Rig time of a round.
const TIME: Duration = Duration::from_hours(8);
/// How often lines are sent.
const LINES_EVERY: Duration = Duration::from_secs(10);
/// How often the one that bakes is asked, in lines.
const ASKED_EVERY: u32 = 6;
/// A piece of time.
const PIECE: Duration = Duration::from_millis(10);

const RIG: &str = r#"
[[drive]]
name = "leader"
model = "SMSD-4.2LAN"
modbus_tcp = "127.0.0.1:0"
[[drive]]
name = "follower"
model = "SMSD-8.0LAN"
modbus_tcp = "127.0.0.1:0"
[[drive]]
name = "shuttle1"
model = "SMSD-4.2LAN"
modbus_tcp = "127.0.0.1:0"
[[drive]]
name = "shuttle2"
model = "SMSD-4.2LAN"
modbus_tcp = "127.0.0.1:0"
[[drive]]
name = "uhv"
model = "SMD3"
serial_tcp = "127.0.0.1:0"
[[drive]]
name = "stage"
model = "SMD3"
serial_tcp = "127.0.0.1:0"
[drive.mechanics]
travel = [-5000.0, 5000.0]
[[drive.switch]]
input = "LIMIT_POSITIVE"
closed = [4800.0, 5000.0]
[[drive]]
name = "idle"
model = "SMD3"
serial_tcp = "127.0.0.1:0"
[[wire]]
from = "leader.relay"
to = "follower.CONTINUE"
[[wire]]
from = "follower.relay"
to = "leader.CONTINUE"
"#;

/// Makes a move, meets the other, and so on; the follower makes half as long a move at half the speed.
const LEADER: &str = "
SET_MAX_SPEED 1000
again:
MOVE_F 320
SET_RELE
WAIT_CONTINUE
SET_WAIT 5ms
CLR_RELE
SET_WAIT 5ms
GOTO_PROGRAM again
";

const FOLLOWER: &str = "
SET_MAX_SPEED 500
again:
MOVE_F 160
SET_RELE
WAIT_CONTINUE
SET_WAIT 5ms
CLR_RELE
SET_WAIT 5ms
GOTO_PROGRAM again
";

const PROGRAMS: [(&str, &str); 4] =
    [("leader", LEADER), ("follower", FOLLOWER), ("shuttle1", SHUTTLE), ("shuttle2", SHUTTLE)];

/// A way in which time passes.
struct Way<'a> {
    name: &'static str,
    /// How far the groups are brought at once.
    piece: Duration,
    goal: Goal<'a>,
}

/// What a round gave.
#[derive(Clone, Copy)]
struct Round {
    wall: Duration,
    /// What happened, looks included.
    events: u32,
}

fn main() {
    if !std::env::args().any(|argument| argument == "--bench") {
        println!("run by `cargo bench`");
        return;
    }
    let file = RigFile::parse(RIG).expect("a valid rig");
    let hot = Condition::parse("uhv.TMOT > 1000", &file).expect("a valid condition");
    let ways = [
        Way { name: "headless", piece: LINES_EVERY, goal: Goal::Time },
        Way { name: "watched", piece: LINES_EVERY, goal: Goal::Condition(&hot) },
        Way { name: "in pieces of 10 ms", piece: PIECE, goal: Goal::Time },
    ];
    println!("eight hours of rig time        wall, ms      x real time       events    events/s, million");
    let rig = Rig::new(&file, |_| true);
    compare(&ways.iter().map(|way| (way.name.to_owned(), way, rig.clone())).collect::<Vec<_>>());
    println!("by itself, headless");
    let alone = file.groups().into_iter().map(|drives| {
        let names: Vec<&str> = drives.iter().map(|drive| file.drives[*drive].name.as_str()).collect();
        (names.join(" and "), &ways[0], Rig::new(&file, |group| group == drives))
    });
    compare(&alone.collect::<Vec<_>>());
}

/// Measures each in turn, round by round, and says what came of it.
fn compare(contenders: &[(String, &Way<'_>, Rig)]) {
    let mut rounds = vec![Vec::new(); contenders.len()];
    for _ in 0..ROUNDS {
        for ((_, way, rig), rounds) in contenders.iter().zip(&mut rounds) {
            rounds.push(rig.clone().round(way));
        }
    }
    for ((name, ..), rounds) in contenders.iter().zip(rounds) {
        let wall = median(rounds.iter().map(|round: &Round| round.wall.as_secs_f64()));
        let events = rounds.first().map_or(0, |round| round.events);
        println!(
            "{name:24} {:14.3} {:16.0} {events:12} {:20.2}",
            wall * 1e3,
            TIME.as_secs_f64() / wall,
            f64::from(events) / wall / 1e6
        );
    }
}

/// Groups of the rig, on a virtual clock.
#[derive(Clone)]
struct Rig {
    groups: Vec<Group>,
    now: Instant,
    /// The drives that lines are sent to.
    uhv: usize,
    stage: usize,
}

impl Rig {
    /// Those groups of the rig that are `wanted`, switched on, with the programs running and the bake begun.
    fn new(file: &RigFile, wanted: impl Fn(&[usize]) -> bool) -> Rig {
        let groups = file.groups().into_iter().filter(|drives| wanted(drives)).map(|drives| {
            let machines = drives.into_iter().map(|drive| (drive, machine(&file.drives[drive]))).collect();
            Group::new(machines, &file.wires, file.seed)
        });
        let drive = |name| file.find_drive(name).expect("in the rig");
        let (uhv, stage) = (drive("uhv"), drive("stage"));
        let mut rig = Rig { groups: groups.collect(), now: Instant::ZERO, uhv, stage };
        for line in ["MODE,4", "BAKET,150", "RUNB"] {
            rig.send(uhv, line);
        }
        rig
    }

    /// Lets the whole time pass.
    fn round(mut self, way: &Way<'_>) -> Round {
        let start = wall();
        let mut budget = u32::MAX;
        let mut lines = 0;
        let end = self.now + TIME;
        while self.now < end {
            let to = self.now + LINES_EVERY;
            self.pass(to, way, &mut budget);
            lines += 1;
            self.send(self.stage, if lines % 2 == 0 { "RUNA,0" } else { "RUNA,1000" });
            if lines % ASKED_EVERY == 0 {
                self.send(self.uhv, "TMOT");
            }
        }
        Round { wall: start.elapsed(), events: u32::MAX - budget }
    }

    /// Lets time pass in the given way.
    fn pass(&mut self, to: Instant, way: &Way<'_>, budget: &mut u32) {
        let mut groups: Vec<&mut Group> = self.groups.iter_mut().collect();
        while self.now < to {
            self.now = self.now + way.piece;
            let arrival = course::run(&mut groups, way.goal, self.now, budget);
            assert_eq!(arrival, Arrival::TimeOver, "neither hot nor out of budget");
        }
    }

    /// Sends a line, which must be accepted, if the drive is among these.
    fn send(&mut self, drive: usize, line: &str) {
        let found = self.groups.iter_mut().find(|group| group.members()[0].drive() == drive);
        let Some(group) = found else { return };
        let reply = group.change(0, |machine, now| {
            machine.smd3_mut().map(|machine| machine.handle(now, decode_line(line.as_bytes())))
        });
        let reply = reply.flatten().expect("an SMD3");
        assert!(reply.outcome.is_ok(), "{line}: {reply:?}");
    }
}

/// A machine that has just been switched on; an SMSD runs its program.
fn machine(drive: &DriveSection) -> AnyMachine {
    match &drive.controller {
        ControllerSection::Smd3(section) => {
            AnyMachine::Smd3(Box::new(section.power_up(drive, Stored::Nothing)))
        }
        ControllerSection::Smsd(section) => {
            let program = PROGRAMS.iter().find(|(name, _)| *name == drive.name);
            AnyMachine::Smsd(Box::new(match program {
                None => section.power_up(drive, Memory::factory()),
                Some((_, text)) => section.start_program(drive, [&words(text), &[], &[], &[]], 0),
            }))
        }
    }
}

#[allow(clippy::disallowed_methods, reason = "a benchmark is about the clock on the wall")]
fn wall() -> Wall {
    Wall::now()
}
