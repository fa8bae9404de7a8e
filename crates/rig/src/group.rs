//! Drives joined by wires, in one order of events.

use crate::action::{Action, Change};
use crate::any::AnyMachine;
use crate::fault::Faults;
use crate::file::WireSection;
use crate::line::{Connection, LineFaults};
use crate::names::{AnyQuantity, AnySignal};
use alloc::string::String;
use alloc::vec::Vec;
use core::time::Duration;
use stepdrive_spec::time::Instant;

/// A drive in a group.
#[derive(Clone, Debug)]
pub struct Member {
    /// Its number in the rig file.
    drive: usize,
    machine: AnyMachine,
    faults: Faults,
    outages: u32,
}

impl Member {
    /// Its number in the rig file, from 0.
    pub fn drive(&self) -> usize {
        self.drive
    }

    /// Its machine.
    pub fn machine(&self) -> &AnyMachine {
        &self.machine
    }

    /// Whether clients can be connected to it: it has its supply, and its line is not cut.
    pub fn reachable(&self) -> bool {
        self.machine.powered() && self.faults.line().connection != Connection::Cut
    }

    /// How many times it has become unreachable. Who was connected when the number was another one is not any more.
    pub fn outages(&self) -> u32 {
        self.outages
    }

    /// What is wrong on its line.
    pub fn line(&self) -> &LineFaults {
        self.faults.line()
    }

    /// What is wrong with it, by name and setting; see [`crate::fault`].
    pub fn faults(&self) -> impl Iterator<Item = (String, String)> {
        self.faults.active(&self.machine)
    }
}

/// A wire from an output to an input.
#[derive(Clone, Copy, Debug)]
struct Wire {
    /// Its number in the rig file.
    number: usize,
    from: usize,
    output: u8,
    to: usize,
    input: AnySignal,
    delay: Duration,
    invert: bool,
    connected: bool,
    /// The level at its end.
    level: bool,
}

/// Something that is to happen in the group at an instant.
#[derive(Clone, Debug)]
enum Due {
    /// An edge arrives at the end of the wire in this place.
    Edge { wire: usize, level: bool },
    /// An action that was put off.
    Action(Action),
}

/// Drives joined by wires, directly or by others: they share one order of events. A drive without wires is a group by
/// itself.
///
/// # How to use one
///
/// [`Group::advance`] lets time pass, [`Group::change`] does something to a machine, [`Group::apply`] does something to
/// the world around it. Time never goes back: what is asked at an earlier time than [`Group::now`] happens then.
#[derive(Clone, Debug)]
pub struct Group {
    now: Instant,
    members: Vec<Member>,
    wires: Vec<Wire>,
    /// What is to come, in order; of what comes at one instant, in the order in which it was put here.
    agenda: Vec<(Instant, Due)>,
    /// The levels of the members' outputs as the wires know them.
    outputs: Vec<u8>,
}

impl Group {
    /// A group of machines that have just been switched on, each with its number in the rig file, and of those of the
    /// file's wires that join them.
    pub fn new(machines: Vec<(usize, AnyMachine)>, wires: &[WireSection], seed: u64) -> Group {
        let members: Vec<Member> =
            machines.into_iter().map(|(drive, machine)| member(drive, machine, seed)).collect();
        let place = |drive| members.iter().position(|member| member.drive == drive);
        let wires = wires.iter().enumerate().filter_map(|(number, wire)| {
            let &WireSection { output, input, delay, invert, .. } = wire;
            let (from, to) = (place(wire.from)?, place(wire.to)?);
            Some(Wire { number, from, output, to, input, delay, invert, connected: true, level: invert })
        });
        let wires = wires.collect();
        let outputs = members.iter().map(|_| 0).collect();
        let mut group = Group { now: Instant::ZERO, members, wires, agenda: Vec::new(), outputs };
        for wire in 0..group.wires.len() {
            group.signal_end_of(wire);
        }
        group.follow_outputs();
        group
    }

    /// The time up to which everything has happened.
    pub fn now(&self) -> Instant {
        self.now
    }

    /// The members, in the order of the rig file.
    pub fn members(&self) -> &[Member] {
        &self.members
    }

    /// When something next happens by itself; `None` while nothing will.
    pub fn next_wake(&self) -> Option<Instant> {
        let machines = self.members.iter().filter_map(|member| member.machine.next_wake());
        machines.chain(self.agenda.first().map(|(at, _)| *at)).min()
    }

    /// Lets everything happen that is due up to `to`, each thing at its own instant, or as much of it as `budget` allows,
    /// which is counted down by one for each. Returns the time reached.
    pub fn advance(&mut self, to: Instant, budget: &mut u32) -> Instant {
        while let Some(at) = self.next_wake().filter(|at| *at <= to) {
            if *budget == 0 {
                return self.now;
            }
            *budget -= 1;
            self.now = self.now.max(at);
            self.happen(at);
        }
        self.now = self.now.max(to);
        self.now
    }

    /// Does something to a member's machine at the present time of the group, to which it has been brought up.
    pub fn change<R>(&mut self, member: usize, act: impl FnOnce(&mut AnyMachine, Instant) -> R) -> Option<R> {
        let now = self.now;
        let outcome = act(&mut self.members.get_mut(member)?.machine, now);
        self.follow_outputs();
        Some(outcome)
    }

    /// A member's machine, to fetch events and unsaved memory from. What changes its course goes by [`Group::change`].
    pub fn machine_mut(&mut self, member: usize) -> Option<&mut AnyMachine> {
        self.members.get_mut(member).map(|member| &mut member.machine)
    }

    /// Carries out an action at the present time of the group, if it is for one of its drives.
    pub fn apply(&mut self, action: &Action) {
        match action {
            Action::Wire { wire, connected } => self.connect(*wire, *connected),
            Action::Drive { drive, change, back_after } => {
                let Some(place) = self.members.iter().position(|member| member.drive == *drive) else {
                    return;
                };
                self.change_member(place, change);
                if let Some((after, back)) = back_after.zip(change.back()) {
                    let back = Action::Drive { drive: *drive, change: back, back_after: None };
                    self.put_off(self.now + after, Due::Action(back));
                }
            }
        }
        self.follow_outputs();
    }

    /// The value of a quantity of a drive of this group at `at`, which lies between the present time of the group and
    /// its next wake-up.
    pub fn look(&self, drive: usize, quantity: AnyQuantity, at: Instant) -> Option<f64> {
        let member = self.members.iter().find(|member| member.drive == drive)?;
        Some(member.machine.look(at, quantity))
    }

    /// The wires, as their number in the rig file, whether they are connected, and the level at their end.
    pub fn wires(&self) -> impl Iterator<Item = (usize, bool, bool)> {
        self.wires.iter().map(|wire| (wire.number, wire.connected, wire.connected && wire.level))
    }

    fn change_member(&mut self, place: usize, change: &Change) {
        let now = self.now;
        let Some(member) = self.members.get_mut(place) else { return };
        let before = member.reachable();
        match change {
            Change::Input { input, to } => to.apply(now, &mut member.machine, *input),
            Change::Power(on) => member.machine.set_power(now, *on),
            Change::Panel { autonomous, program } => {
                if let Some(machine) = member.machine.smsd_mut() {
                    machine.change(now, |drive| drive.set_panel(*autonomous, *program));
                }
            }
            Change::Fault(fault) => member.faults.set(now, &mut member.machine, fault),
        }
        if before && !member.reachable() {
            member.outages = member.outages.wrapping_add(1);
        }
    }

    /// Lets happen what is due at `at`: first in the machines, then on the wires and what was put off.
    fn happen(&mut self, at: Instant) {
        for member in &mut self.members {
            if member.machine.next_wake().is_some_and(|wake| wake <= at) {
                member.machine.advance(at);
            }
        }
        self.follow_outputs();
        while self.agenda.first().is_some_and(|(due, _)| *due <= at) {
            match self.agenda.remove(0).1 {
                Due::Edge { wire, level } => self.arrive(wire, level),
                Due::Action(action) => self.apply(&action),
            }
        }
    }

    /// Lets the wires know the outputs that have changed. What arrives at once may change others.
    fn follow_outputs(&mut self) {
        if self.wires.is_empty() {
            return;
        }
        while let Some((from, changed)) = self.changed_outputs() {
            for wire in 0..self.wires.len() {
                self.follow_output(wire, from, changed);
            }
        }
    }

    /// The first member whose outputs have changed, and which of them, a bit each.
    fn changed_outputs(&mut self) -> Option<(usize, u8)> {
        let known = self.outputs.iter_mut().zip(&self.members).enumerate();
        known.into_iter().find_map(|(place, (known, member))| {
            let outputs = member.machine.outputs();
            let changed = core::mem::replace(known, outputs) ^ outputs;
            (changed != 0).then_some((place, changed))
        })
    }

    fn follow_output(&mut self, number: usize, from: usize, changed: u8) {
        let Some(wire) = self.wires.get(number).copied() else { return };
        let bit = 1 << wire.output;
        if wire.from != from || changed & bit == 0 {
            return;
        }
        let level = (self.outputs.get(from).is_some_and(|outputs| outputs & bit != 0)) != wire.invert;
        if wire.delay.is_zero() {
            self.arrive(number, level);
        } else {
            self.put_off(self.now + wire.delay, Due::Edge { wire: number, level });
        }
    }

    fn arrive(&mut self, wire: usize, level: bool) {
        if let Some(wire) = self.wires.get_mut(wire) {
            wire.level = level;
        }
        self.signal_end_of(wire);
    }

    fn connect(&mut self, number: usize, connected: bool) {
        let Some(place) = self.wires.iter().position(|wire| wire.number == number) else { return };
        if let Some(wire) = self.wires.get_mut(place) {
            wire.connected = connected;
        }
        self.signal_end_of(place);
    }

    /// Tells the input at the end of a wire what all wires that end there give.
    fn signal_end_of(&mut self, wire: usize) {
        let Some(&Wire { to, input, .. }) = self.wires.get(wire) else { return };
        let ends_there = |wire: &&Wire| wire.to == to && wire.input == input;
        let present = self.wires.iter().filter(ends_there).any(|wire| wire.connected && wire.level);
        let now = self.now;
        if let Some(member) = self.members.get_mut(to) {
            member.machine.set_signal(now, input, present);
        }
    }

    fn put_off(&mut self, at: Instant, due: Due) {
        let place = self.agenda.partition_point(|(other, _)| *other <= at);
        self.agenda.insert(place, (at, due));
    }
}

fn member(drive: usize, mut machine: AnyMachine, seed: u64) -> Member {
    // Two drives of a rig bounce differently.
    machine.set_seed(seed.wrapping_add(drive as u64));
    Member { drive, machine, faults: Faults::default(), outages: 0 }
}
