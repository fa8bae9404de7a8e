//! What the suite wants to know of a line, and what is otherwise on each.

use crate::common::link::Fault;
use crate::common::station::{Bench, Protocol};
use proptest::prelude::BoxedStrategy;
use std::time::Duration;
use stepdrive_host::smsd::SmsdOptions;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;

pub(crate) type BenchOf<L> = Bench<<L as Line>::Protocol>;
pub(crate) type ActOf<L> = <<L as Line>::Protocol as Protocol>::Act;

/// A way to a controller.
pub(crate) trait Line: 'static {
    type Protocol: Protocol;

    /// A controller fresh from the factory, and a client with these options.
    fn with(model: Model, options: SmsdOptions) -> BenchOf<Self>;

    /// How many kinds of controller there are on this line.
    const KINDS: usize;

    /// One of each kind, and clients that know no more of them than of any other.
    fn kinds() -> Vec<BenchOf<Self>>;

    fn of(options: SmsdOptions) -> BenchOf<Self> {
        Self::with(Model::Smsd42, options)
    }

    fn fresh() -> BenchOf<Self> {
        Self::of(SmsdOptions::default())
    }

    /// With a client that is logged in.
    async fn ready() -> BenchOf<Self> {
        Self::fresh().logged_in().await
    }

    // ---- what acts

    fn command(opcode: Opcode) -> ActOf<Self>;

    fn coil(coil: Reg) -> ActOf<Self>;

    fn password() -> ActOf<Self>;

    /// What has acted, but what is only a part of something longer.
    fn acts(bench: &BenchOf<Self>) -> Vec<ActOf<Self>> {
        bench.acts()
    }

    // ---- what goes wrong

    /// What this line may do to one request, besides what any may, that leaves it readable at the next try.
    fn own_troubles() -> Vec<Fault>;

    /// The same at random, whether it is readable afterwards or not, with its weight; what any line may do has 22.
    fn own_fault() -> (u32, BoxedStrategy<Fault>);

    /// Whether a request goes out although nobody waited for the reply to the one before, and it has not come.
    const SENDS_AHEAD: bool;

    /// Whether bytes may get lost or changed on the way.
    const SERIAL: bool = false;

    /// What of this protocol alone keeps a reply from being one.
    const NO_REPLY: &[Fault];

    /// The longest that a read takes with one trouble.
    const LONGEST_READ: Duration;

    /// The longest that the first read takes with one trouble.
    const LONGEST_LOGIN: Duration;

    // ---- requests

    /// How many log in.
    const LOGIN: usize;
    /// How many of a command with an operand go out before the command.
    const BEFORE_COMMAND: usize;
    /// How many a command with an operand takes.
    const COMMAND: u64;
    /// How many stop the program.
    const STOP_PROGRAM: u64;
    /// How many of a change of the password go out before it.
    const BEFORE_PASSWORD: usize;
    /// How many tell what the motor does.
    const SNAPSHOT: u64;
    /// How many tell the whole state.
    const STATE: u64;
    /// How many read the whole map.
    const WHOLE_MAP: u64;
    /// How many read these together.
    const READS: &[(&[Reg], u64)];
    /// How many write five parameters together.
    const FIVE_WRITES: u64;

    /// Bytes of the request that carries out this instruction.
    fn length(opcode: Opcode) -> usize;

    /// How many instructions of a program go into one request.
    const BLOCK: usize;

    // ---- registers

    /// How many rows of the map cannot be read, or tell nothing.
    const UNREADABLE: usize;

    /// Rows for whose range the controller is asked.
    const ASKED_FOR_RANGE: &[Reg];

    /// Whether a register can be written as a value over this line, and does nothing but hold it.
    fn takes_value(reg: Reg) -> bool;

    /// Registers that hold a value and take any within their range at any time, whatever the model.
    const HELD: &[Reg];

    /// One with a range as wide as they have here.
    const WIDE: (Reg, i64);

    /// Whether what the controller shows of a register is what this line tells of it.
    fn compares(_reg: Reg) -> bool {
        true
    }

    /// What a register holds, in the controller or, where it has no place for it there, in the client.
    fn holds(bench: &BenchOf<Self>, reg: Reg, index: u16) -> i64 {
        bench.look(reg, index)
    }

    /// Puts something into registers that are of use over this line.
    async fn fill(bench: &BenchOf<Self>);

    /// Looks at what the controller shows in a register that only this protocol writes.
    fn check_shown(_bench: &BenchOf<Self>, _reg: Reg, _value: i64) {}

    /// Whether it is told that no program runs.
    const TELLS_WHETHER_A_PROGRAM_RUNS: bool;

    // ---- words

    /// What errors call the controller.
    const CONTROLLER: &'static str;
    /// What is said of a password besides that it is not accepted.
    const OF_THE_PASSWORD: &'static str;
    /// Refusals, from behind the name.
    const PROGRAM_RUNS: &'static str;
    const ENERGISED: &'static str;

    /// What is said of a controller whose last command from here was this one.
    fn state_behind(_last: Opcode, motor: &str) -> String {
        motor.to_owned()
    }
}
