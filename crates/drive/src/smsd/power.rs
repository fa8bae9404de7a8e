//! The supply, the front panel, and what goes wrong with the motor and its chip.

use super::Smsd;
use super::commands::CommandRegisters;
use super::counters::Counters;
use super::inputs::Inputs;
use super::interpreter::Interpreter;
use super::memory::Record;
use super::programs::Programs;
use stepdrive_spec::smsd::instructions::PROGRAM_AREAS;
use stepdrive_spec::smsd::standard::Counter;
use stepdrive_spec::time::Instant;

impl Smsd {
    /// The supply goes at `now`: the motor stands where it is, de-energised, a running program and a procedure of
    /// `MEM_CMD` end, and everything volatile is lost. [`Smsd::take_unsaved`] still names what is to be stored.
    pub fn switch_off(&mut self, now: Instant) {
        self.motor.reset(now);
        self.start_over(0);
        self.on = false;
    }

    /// The supply comes back at `now`, with the inputs at `levels` (a bit each): as [`Smsd::power_up`], with what the
    /// memory holds. The rotor's place is 0 again.
    pub fn switch_on(&mut self, now: Instant, levels: u8) {
        self.motor = self.motor.powered_up(self.memory.motor.microsteps_per_step());
        self.start_over(levels);
        self.logins.start_over(now);
        if self.motor.is_overheated() {
            self.count(Counter::ThermalPowerstep01);
        }
        self.on = true;
        if self.config.autonomous {
            self.start_program(now, self.memory.mode_n_programs);
        }
    }

    /// Sets the front panel: autonomous mode ("bF") or LAN mode ("LA"), and `MODE_N_PROGRAMS` if it is given, 0 to 3;
    /// another number is none. ASSUMED: the mode counts from the next power-up on, the number is stored at once; the
    /// manual tells of no other effect.
    pub fn set_panel(&mut self, autonomous: bool, program: Option<u8>) {
        self.config.autonomous = autonomous;
        let chosen = program.filter(|number| usize::from(*number) < PROGRAM_AREAS);
        if let Some(number) = chosen.filter(|number| *number != self.memory.mode_n_programs) {
            self.memory.mode_n_programs = number;
            self.unsaved.mark(Record::ModeNPrograms);
        }
    }

    /// Whether the front panel is at autonomous mode ("bF"), which counts at the next power-up.
    pub fn autonomous(&self) -> bool {
        self.config.autonomous
    }

    /// Short-circuits the motor at `now`, or ends that. While a current flows the motor chip's overcurrent protection shuts
    /// the bridges down: the motor is in HiZ, its motion has ended, and `ABS_POS` keeps its number. Every command that
    /// would energise it ends so at once. The bridges can be used again after the short circuit has ended and `CLR`, a reset
    /// of the motor chip or a power-up has followed.
    pub fn short_motor(&mut self, now: Instant, shorted: bool) {
        self.motor.short_motor(now, shorted);
        self.follow_shutdown(now);
    }

    /// Overheats the motor chip at `now`, or ends that. Its thermal protection shuts the bridges down as a short circuit
    /// does, whether or not a current flows.
    pub fn overheat(&mut self, now: Instant, overheated: bool) {
        if overheated && !self.motor.is_overheated() {
            self.count(Counter::ThermalPowerstep01);
        }
        self.motor.overheat(now, overheated);
        self.follow_shutdown(now);
    }

    /// A motion that waited for a signal has ended with the bridges, and a program that waited for `READY` goes on.
    fn follow_shutdown(&mut self, now: Instant) {
        if self.motor.is_shut_down() {
            self.seek = None;
            self.release_program(now);
        }
    }

    /// Forgets everything volatile but the motor chip's.
    fn start_over(&mut self, levels: u8) {
        self.lan = self.memory.lan;
        self.inputs = Inputs::power_up(levels);
        self.seek = None;
        self.registers = CommandRegisters::power_up();
        self.programs = Programs::power_up();
        self.interpreter = Interpreter::default();
        self.relay = false;
        self.counters = Counters::default();
    }
}
