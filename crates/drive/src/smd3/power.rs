//! The supply, and what can be done to the drive from outside: its winding heated, its flash worn out or damaged.

use super::Smd3;
use super::joystick::Joystick;
use super::ramp::Ramp;
use super::settings::{Settings, Stored};
use stepdrive_spec::smd3::flags::{ErrorFlag, FlagBits};
use stepdrive_spec::smd3::signals::Signal;
use stepdrive_spec::time::Instant;

/// Temperatures that a winding can be held at, °C.
const HOLDABLE: (f64, f64) = (-273.15, 1e4);

impl Smd3 {
    /// The supply goes at `now`: the motor stands where it is, without current, and cools; everything volatile is lost.
    pub fn switch_off(&mut self, now: Instant) {
        self.on = false;
        self.errors = 0;
        self.ramp = self.ramp.without_supply(now);
        self.forget_motion();
        self.supply_motor(now);
    }

    /// The supply comes back at `now`, with the signals at `signals` (a bit each): as [`Smd3::power_up`], with the settings
    /// that the flash holds and the winding as warm as it is by then. The rotor's place is 0 again.
    pub fn switch_on(&mut self, now: Instant, signals: u16) {
        self.on = true;
        self.signals = signals;
        (self.settings, self.errors) = self.configuration();
        self.ramp = Ramp::power_up();
        self.forget_motion();
        self.plug_joystick(now, self.present(Signal::Joystick));
        self.update(now);
    }

    /// What the flash gives at power-up: the settings, and the error flags that follow.
    fn configuration(&self) -> (Settings, FlagBits) {
        match self.stored {
            Stored::Intact(settings) if !self.store_damaged => (settings, 0),
            Stored::Nothing if !self.store_damaged => (Settings::factory(), 0),
            Stored::Nothing | Stored::Intact(_) | Stored::Damaged => {
                (Settings::factory(), ErrorFlag::ConfigurationError.mask())
            }
        }
    }

    fn forget_motion(&mut self) {
        self.homing = None;
        self.joystick = Joystick::default();
        self.bake = false;
    }

    /// Whether it has its supply.
    pub fn is_on(&self) -> bool {
        self.on
    }

    /// From `now` on something outside holds the winding at `temperature` °C, whatever current flows; `None`: from there
    /// it warms and cools by itself again. Brought into -273.15 to 10 000 °C; what is not a number is the lower end.
    pub fn heat(&mut self, now: Instant, temperature: Option<f64>) {
        self.handle_wake(now);
        let (lowest, highest) = HOLDABLE;
        self.held_at = temperature.map(|celsius| celsius.max(lowest).min(highest));
        self.drive_winding(now);
        self.update(now);
    }

    /// What the winding is held at, °C; `None` while it warms and cools by itself.
    pub fn held_at(&self) -> Option<f64> {
        self.held_at
    }

    /// The flash is worn out, or is not: while it is, `STORE` fails and the flash holds what it held.
    pub fn wear_flash(&mut self, worn: bool) {
        self.flash_worn = worn;
    }

    /// Whether the flash is worn out.
    pub fn flash_worn(&self) -> bool {
        self.flash_worn
    }

    /// What the flash holds fails its check, or does not any more: while it does, `LOAD` fails, and a power-up finds a
    /// configuration error and takes the factory's settings. What is stored is not lost, but for a `STORE`: that writes
    /// over it, and ends the damage.
    pub fn damage_store(&mut self, damaged: bool) {
        self.store_damaged = damaged;
        self.damage_mended = false;
    }

    /// Whether what the flash holds fails its check, by [`Smd3::damage_store`] or since power-up.
    pub fn store_damaged(&self) -> bool {
        self.store_damaged || self.stored == Stored::Damaged
    }
}
