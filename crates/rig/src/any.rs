//! A machine of either family.

use crate::contacts::SwitchFault;
use crate::machine::Machine;
use crate::names::{AnyQuantity, AnySignal};
use crate::pulses::Train;
use alloc::boxed::Box;
use stepdrive_drive::controller::Controller;
use stepdrive_drive::smd3::Smd3;
use stepdrive_drive::smsd::Smsd;
use stepdrive_spec::smd3;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::time::Instant;

/// A machine of either family. Where a signal or quantity is asked for, it must be one of its own family; one of the
/// other does nothing and reads as 0.
#[derive(Clone, Debug)]
pub enum AnyMachine {
    /// An SMSD.
    Smsd(Box<Machine<Smsd>>),
    /// An SMD3.
    Smd3(Box<Machine<Smd3>>),
}

/// Does the same with a machine of either family.
macro_rules! either {
    ($machine:expr, $bound:ident => $act:expr) => {
        match $machine {
            AnyMachine::Smsd($bound) => $act,
            AnyMachine::Smd3($bound) => $act,
        }
    };
}

/// Does the same with a machine and a signal, both of one family; `$otherwise` when they are of different ones.
macro_rules! signalled {
    ($machine:expr, $input:expr, $bound:ident, $signal:ident => $act:expr, $otherwise:expr) => {
        match ($machine, $input) {
            (AnyMachine::Smsd($bound), AnySignal::Smsd($signal)) => $act,
            (AnyMachine::Smd3($bound), AnySignal::Smd3($signal)) => $act,
            (AnyMachine::Smsd(_), AnySignal::Smd3(_)) | (AnyMachine::Smd3(_), AnySignal::Smsd(_)) => {
                $otherwise
            }
        }
    };
}

impl AnyMachine {
    /// The machine, if it is an SMSD.
    pub fn smsd(&self) -> Option<&Machine<Smsd>> {
        match self {
            AnyMachine::Smsd(machine) => Some(machine),
            AnyMachine::Smd3(_) => None,
        }
    }

    /// The machine, if it is an SMSD.
    pub fn smsd_mut(&mut self) -> Option<&mut Machine<Smsd>> {
        match self {
            AnyMachine::Smsd(machine) => Some(machine),
            AnyMachine::Smd3(_) => None,
        }
    }

    /// The machine, if it is an SMD3.
    pub fn smd3(&self) -> Option<&Machine<Smd3>> {
        match self {
            AnyMachine::Smsd(_) => None,
            AnyMachine::Smd3(machine) => Some(machine),
        }
    }

    /// The machine, if it is an SMD3.
    pub fn smd3_mut(&mut self) -> Option<&mut Machine<Smd3>> {
        match self {
            AnyMachine::Smsd(_) => None,
            AnyMachine::Smd3(machine) => Some(machine),
        }
    }

    /// See [`Machine::next_wake`].
    pub fn next_wake(&self) -> Option<Instant> {
        either!(self, machine => machine.next_wake())
    }

    /// See [`Machine::advance`].
    pub fn advance(&mut self, now: Instant) {
        either!(self, machine => machine.advance(now));
    }

    /// See [`Machine::set_seed`].
    pub fn set_seed(&mut self, seed: u64) {
        either!(self, machine => machine.set_seed(seed));
    }

    /// See [`Machine::powered`].
    pub fn powered(&self) -> bool {
        either!(self, machine => machine.powered())
    }

    /// See [`Machine::switch_on`] and [`Machine::switch_off`].
    pub fn set_power(&mut self, now: Instant, on: bool) {
        either!(self, machine => if on { machine.switch_on(now) } else { machine.switch_off(now) });
    }

    /// See [`Machine::block_rotor`].
    pub fn block_rotor(&mut self, now: Instant, blocked: bool) {
        either!(self, machine => machine.block_rotor(now, blocked));
    }

    /// See [`Machine::outputs`].
    pub fn outputs(&self) -> u8 {
        either!(self, machine => machine.outputs())
    }

    /// See [`Controller::OUTPUTS`].
    pub fn output_names(&self) -> &'static [&'static str] {
        match self {
            AnyMachine::Smsd(_) => Smsd::OUTPUTS,
            AnyMachine::Smd3(_) => Smd3::OUTPUTS,
        }
    }

    /// See [`Machine::levels`].
    pub fn levels(&self) -> u16 {
        either!(self, machine => machine.levels())
    }

    /// All inputs.
    pub fn inputs(&self) -> impl Iterator<Item = AnySignal> + use<> {
        let (smsd, smd3): (&[Input], &[smd3::signals::Signal]) = match self {
            AnyMachine::Smsd(_) => (&Input::ALL, &[]),
            AnyMachine::Smd3(_) => (&[], &smd3::signals::Signal::ALL),
        };
        let smsd = smsd.iter().map(|input| AnySignal::Smsd(*input));
        smsd.chain(smd3.iter().map(|signal| AnySignal::Smd3(*signal)))
    }

    /// Whether an input has a switch.
    pub fn has_switch(&self, input: AnySignal) -> bool {
        signalled!(self, input, machine, signal =>
            machine.switches().iter().any(|switch| switch.input == signal), false)
    }

    /// See [`Machine::set_signal`].
    pub fn set_signal(&mut self, now: Instant, input: AnySignal, present: bool) {
        signalled!(self, input, machine, signal => machine.set_signal(now, signal, present), ());
    }

    /// See [`Machine::force`].
    pub fn force(&mut self, now: Instant, input: AnySignal, level: Option<bool>) {
        signalled!(self, input, machine, signal => machine.force(now, signal, level), ());
    }

    /// See [`Machine::forced`].
    pub fn forced(&self, input: AnySignal) -> Option<bool> {
        signalled!(self, input, machine, signal => machine.forced(signal), None)
    }

    /// See [`Machine::pulse`].
    pub fn pulse(&mut self, now: Instant, input: AnySignal, train: Train) {
        signalled!(self, input, machine, signal => machine.pulse(now, signal, train), ());
    }

    /// See [`Machine::set_switch_fault`].
    pub fn set_switch_fault(&mut self, now: Instant, input: AnySignal, fault: SwitchFault) -> bool {
        signalled!(self, input, machine, signal => machine.set_switch_fault(now, signal, fault), false)
    }

    /// The value of a quantity at `now`, which may lie between the last call and the next wake-up. What only a controller
    /// with its supply has is 0 without it.
    pub fn look(&self, now: Instant, quantity: AnyQuantity) -> f64 {
        let number = |flag: bool| f64::from(u8::from(flag));
        match (self, quantity) {
            (_, AnyQuantity::Powered) => number(self.powered()),
            (_, AnyQuantity::Carriage) => either!(self, machine => machine.carriage(now)),
            (_, AnyQuantity::Stalled) => number(either!(self, machine => machine.stalled(now))),
            (AnyMachine::Smsd(machine), AnyQuantity::Smsd(quantity)) => machine.drive().look(now, quantity),
            (AnyMachine::Smd3(machine), AnyQuantity::Smd3(quantity)) => machine.drive().look(now, quantity),
            (_, AnyQuantity::Smsd(_) | AnyQuantity::Smd3(_)) => 0.0,
        }
    }

    /// See [`Machine::destination`].
    pub fn destination(&self, now: Instant) -> Option<f64> {
        either!(self, machine => machine.destination(now))
    }

    /// What survives power-off, as byte strings; see [`Controller::for_each_record`].
    pub fn for_each_record(&self, field: &mut dyn FnMut(&[u8])) {
        either!(self, machine => machine.drive().for_each_record(field));
    }
}
