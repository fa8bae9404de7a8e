//! A rig on a virtual clock, and verbs that say what a test does.

use std::time::Duration;
use stepdrive_asm::{SourceFile, assemble};
use stepdrive_drive::smd3::Stored;
use stepdrive_drive::smsd::{Memory, Session};
use stepdrive_proto::smd3::decode_line;
use stepdrive_rig::action::Action;
use stepdrive_rig::any::AnyMachine;
use stepdrive_rig::condition::Condition;
use stepdrive_rig::course::{self, Arrival, Goal};
use stepdrive_rig::file::{ControllerSection, RigFile};
use stepdrive_rig::group::Group;
use stepdrive_spec::modbus::{Reply, Request};
use stepdrive_spec::smd3::commands::Value;
use stepdrive_spec::smd3::errors::Error;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::time::Instant;

pub(crate) const MS: Duration = Duration::from_millis(1);
pub(crate) const SECOND: Duration = Duration::from_secs(1);

/// Two SMSDs, each with its relay wired to the other's CONTINUE.
pub(crate) const PAIR: &str = r#"
[[drive]]
name = "a"
model = "SMSD-4.2LAN"
modbus_tcp = "127.0.0.1:0"
[[drive]]
name = "b"
model = "SMSD-8.0LAN"
modbus_tcp = "127.0.0.1:0"
[[wire]]
from = "a.relay"
to = "b.CONTINUE"
[[wire]]
from = "b.relay"
to = "a.CONTINUE"
"#;

/// One drive of each family, on a travel with switches.
pub(crate) const STAGE_AND_UHV: &str = r#"
[rig]
seed = 7
[[drive]]
name = "stage"
model = "SMSD-4.2LAN"
modbus_tcp = "127.0.0.1:0"
[drive.mechanics]
travel = [-1000.0, 1000.0]
[[drive.switch]]
input = "IN0"
closed = [300.0, 320.0]
[[drive]]
name = "uhv"
model = "SMD3"
serial_tcp = "127.0.0.1:0"
[drive.mechanics]
travel = [-2000.0, 2000.0]
[[drive.switch]]
input = "LIMIT_POSITIVE"
closed = [1500.0, 2000.0]
"#;

/// A rig, and the time.
#[derive(Clone)]
pub(crate) struct Bench {
    pub(crate) rig: RigFile,
    pub(crate) groups: Vec<Group>,
    pub(crate) now: Instant,
    session: Session,
}

impl Bench {
    /// A rig with these programs in its SMSDs, switched on; a drive with a program runs it.
    pub(crate) fn new(rig: &str, programs: &[(&str, &str)]) -> Bench {
        let rig = RigFile::parse(rig).unwrap_or_else(|error| panic!("{}", error.render("rig")));
        let machines = (0..rig.drives.len()).map(|drive| Some((drive, machine(&rig, drive, programs))));
        let mut machines: Vec<_> = machines.collect();
        let mut take = |drives: Vec<usize>| {
            let machines = drives.into_iter().filter_map(|drive| machines[drive].take()).collect();
            Group::new(machines, &rig.wires, rig.seed)
        };
        let groups = rig.groups().into_iter().map(&mut take).collect();
        Bench { rig, groups, now: Instant::ZERO, session: Session::new() }
    }

    /// Lets time pass.
    pub(crate) fn pass(&mut self, time: Duration) {
        self.now = self.now + time;
        for group in &mut self.groups {
            assert_eq!(group.advance(self.now, &mut u32::MAX.clone()), self.now);
        }
    }

    /// Does something to the rig now.
    pub(crate) fn act(&mut self, action: &str) {
        let action = Action::parse(action, &self.rig).unwrap_or_else(|error| panic!("{action}: {error}"));
        assert_eq!(Action::parse(&action.text(&self.rig), &self.rig), Ok(action.clone()));
        self.pass(Duration::ZERO);
        for group in &mut self.groups {
            group.apply(&action);
        }
    }

    /// What a quantity is now, as in `stage.ABS_POS`.
    pub(crate) fn look(&self, name: &str) -> f64 {
        let (drive, quantity) = name.split_once('.').expect("drive and quantity");
        let drive = self.rig.find_drive(drive).expect("there");
        let quantity = self.rig.find_quantity(drive, quantity).expect("there");
        self.groups.iter().find_map(|group| group.look(drive, quantity, self.now)).expect("in a group")
    }

    /// Goes on until a condition holds, within a time; `true` when it came to.
    pub(crate) fn until(&mut self, condition: &str, within: Duration) -> bool {
        let condition = Condition::parse(condition, &self.rig).unwrap_or_else(|error| panic!("{error}"));
        self.run(Goal::Condition(&condition), within)
    }

    /// Goes on until nothing will happen by itself, within a time.
    pub(crate) fn until_idle(&mut self, within: Duration) -> bool {
        self.run(Goal::Idle, within)
    }

    fn run(&mut self, goal: Goal<'_>, within: Duration) -> bool {
        let until = self.now + within;
        let mut groups: Vec<&mut Group> = self.groups.iter_mut().collect();
        let arrival = course::run(&mut groups, goal, until, &mut u32::MAX.clone());
        self.now = match arrival {
            Arrival::Reached(at) => at,
            Arrival::TimeOver => until,
            Arrival::OutOfBudget(_) => panic!("the budget was for all"),
        };
        assert!(self.groups.iter().all(|group| group.now() == self.now));
        matches!(arrival, Arrival::Reached(_))
    }

    /// Sends a line to an SMD3.
    pub(crate) fn line(&mut self, drive: &str, line: &str) -> Result<Option<Value>, Error> {
        let (now, number) = (self.now, self.rig.find_drive(drive).expect("there"));
        let (group, member) = self.find(number);
        let reply = group.change(member, |machine, at| {
            assert_eq!(at, now);
            machine.smd3_mut().expect("an SMD3").handle(at, decode_line(line.as_bytes()))
        });
        reply.expect("a member").outcome
    }

    /// Writes an SMSD's register, or `CMD`.
    pub(crate) fn write(&mut self, drive: &str, reg: Reg, value: i64) {
        let number = self.rig.find_drive(drive).expect("there");
        let mut session = core::mem::take(&mut self.session);
        let (group, member) = self.find(number);
        group.change(member, |machine, at| {
            let machine = machine.smsd_mut().expect("an SMSD");
            let login = [0xCDEF, 0x89AB, 0x4567, 0x0123, 0].into_iter().collect();
            let login = Request::WriteRegisters { address: 0x2100, values: login };
            assert_eq!(machine.handle(at, &mut session, &login), Ok(Reply::Written));
            let address = reg.info().address;
            let request = if reg.info().kind.width() == 2 {
                let [low, high] =
                    [value & 0xFFFF, value >> 16 & 0xFFFF].map(|word| u16::try_from(word).expect("a word"));
                Request::WriteRegisters { address, values: [low, high].into_iter().collect() }
            } else if reg.info().table.is_bits() {
                Request::WriteCoil { address, value: value != 0 }
            } else {
                Request::WriteRegister { address, value: u16::try_from(value).expect("a word") }
            };
            assert_eq!(machine.handle(at, &mut session, &request), Ok(Reply::Written), "{reg:?}");
        });
        self.session = session;
    }

    /// Writes `CMD`.
    pub(crate) fn command(&mut self, drive: &str, opcode: Opcode) {
        self.write(drive, Reg::Cmd, i64::from(opcode.code()));
    }

    fn find(&mut self, drive: usize) -> (&mut Group, usize) {
        self.pass(Duration::ZERO);
        let found = self.groups.iter_mut().find_map(|group| {
            let member = group.members().iter().position(|member| member.drive() == drive)?;
            Some((group, member))
        });
        found.expect("every drive is in a group")
    }

    /// Everything that can be seen of the rig, to compare.
    pub(crate) fn state(&self) -> Vec<(usize, u64)> {
        let drives = self.rig.drives.iter().enumerate();
        let all =
            drives.flat_map(|(number, drive)| drive.quantities().map(move |quantity| (number, quantity)));
        let value = |drive, quantity| {
            let value = self.groups.iter().find_map(|group| group.look(drive, quantity, self.now));
            value.expect("every drive is in a group").to_bits()
        };
        all.map(|(drive, quantity)| (drive, value(drive, quantity))).collect()
    }
}

fn machine(rig: &RigFile, number: usize, programs: &[(&str, &str)]) -> AnyMachine {
    let drive = &rig.drives[number];
    match &drive.controller {
        ControllerSection::Smd3(section) => {
            AnyMachine::Smd3(Box::new(section.power_up(drive, Stored::Nothing)))
        }
        ControllerSection::Smsd(section) => {
            let program = programs.iter().find(|(name, _)| *name == drive.name);
            AnyMachine::Smsd(Box::new(match program {
                None => section.power_up(drive, Memory::factory()),
                Some((name, text)) => {
                    let image = assemble(&SourceFile::new(*name, *text)).image.expect("no errors");
                    section.start_program(drive, std::array::from_fn(|area| image.area(area)), 0)
                }
            }))
        }
    }
}
