//! The STATUS word: the low byte of the powerSTEP01's status register, unchanged (ch. 4.3; decision 14).

/// What the motor does, bits 6:5 of STATUS.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum MotStatus {
    /// Stands still.
    #[default]
    Stopped = 0,
    /// Gains speed.
    Accelerating = 1,
    /// Loses speed.
    Decelerating = 2,
    /// Turns at constant speed.
    ConstantSpeed = 3,
}

/// The flags of the STATUS word, also readable one by one as discrete inputs 0x1200 to 0x1209.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(clippy::struct_excessive_bools, reason = "the flags of a status word are what they are")]
pub struct Status {
    /// Bit 0, `HiZ`: the motor's phases are de-energised.
    pub hi_z: bool,
    /// Bit 1, `READY`: the last motion command has been carried out (the chip's BUSY pin, which is low while it works).
    pub ready: bool,
    /// Bit 2, `SW_F`: the SW contact is closed.
    pub sw_f: bool,
    /// Bit 3, `SW_EVN`: the SW contact has closed since the flags were last cleared.
    pub sw_evn: bool,
    /// Bit 4, `DIR`: the direction of the last motion was forward.
    pub forward: bool,
    /// Bits 6:5.
    pub motion: MotStatus,
    /// Bit 7, `CMD_ERROR`: a command could not be carried out since the flags were last cleared.
    pub cmd_error: bool,
}

impl Status {
    /// The status word, upper byte 0.
    pub const fn word(self) -> u16 {
        self.hi_z as u16
            | (self.ready as u16) << 1
            | (self.sw_f as u16) << 2
            | (self.sw_evn as u16) << 3
            | (self.forward as u16) << 4
            | (self.motion as u16) << 5
            | (self.cmd_error as u16) << 7
    }

    /// The flags in a status word. The upper byte is reserved and ignored.
    pub const fn from_word(word: u16) -> Status {
        Status {
            hi_z: word & 1 != 0,
            ready: word & 1 << 1 != 0,
            sw_f: word & 1 << 2 != 0,
            sw_evn: word & 1 << 3 != 0,
            forward: word & 1 << 4 != 0,
            motion: match word >> 5 & 3 {
                0 => MotStatus::Stopped,
                1 => MotStatus::Accelerating,
                2 => MotStatus::Decelerating,
                _ => MotStatus::ConstantSpeed,
            },
            cmd_error: word & 1 << 7 != 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_status_seen_on_hardware_reads_as_described() {
        // Energised, free, forward, stopped; then the same after a refused command.
        let status = Status::from_word(0x12);
        assert!(!status.hi_z && status.ready && status.forward && !status.cmd_error);
        assert_eq!(status.motion, MotStatus::Stopped);
        assert!(Status::from_word(0x92).cmd_error);
    }

    #[test]
    fn every_status_byte_survives_the_round_trip() {
        for word in 0..=0xFF {
            assert_eq!(Status::from_word(word).word(), word);
        }
    }
}
