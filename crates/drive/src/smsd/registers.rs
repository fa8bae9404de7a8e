//! The register map, read and written (App. A; decisions 1 to 9 and 13).
//!
//! A request touches a range of addresses. The range is walked row by row of the spec's table; a request is either
//! refused before anything has changed, or carried out whole.

use super::memory::Record;
use super::powerstep01::{Parameters, PowerStep01};
use super::{Session, Smsd, WordOrder};
use stepdrive_spec::modbus::{Bits, Exception, Table, Words};
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::mode::MotorConfiguration;
use stepdrive_spec::smsd::models::{FIRMWARE, HW_VER, REGISTER_MAP};
use stepdrive_spec::smsd::registers::{Access, Kind, Limits, REGISTERS, Reg, Register, Writable};
use stepdrive_spec::smsd::status::MotStatus;
use stepdrive_spec::time::Instant;

/// The part of a request that lies in one row of the table.
#[derive(Clone, Copy)]
struct Span {
    row: &'static Register,
    /// The first address, from the row's.
    offset: u16,
    /// How many addresses.
    count: u16,
}

impl Span {
    /// The number within the row, and the half of a 32-bit value, at each of the span's addresses.
    fn places(self) -> impl Iterator<Item = Place> {
        let halves = self.row.kind.width() == 2;
        let place = move |at| {
            if halves { Place { index: at / 2, half: at % 2 } } else { Place { index: at, half: 0 } }
        };
        (self.offset..self.offset + self.count).map(place)
    }
}

/// One address in a row.
#[derive(Clone, Copy)]
struct Place {
    index: u16,
    half: u16,
}

/// The rows under `count` addresses from `address`; an error when one of the addresses is not listed.
fn spans(table: Table, address: u16, count: u16) -> Result<impl Iterator<Item = Span> + Clone, Exception> {
    let key = |table: Table, address: u16| (table as u32) << 16 | u32::from(address);
    let behind = REGISTERS.partition_point(|row| key(row.table, row.address) <= key(table, address));
    let rows = REGISTERS.get(behind.saturating_sub(1)..).unwrap_or(&[]);
    let end = address.checked_add(count).ok_or(Exception::IllegalDataAddress)?;
    let mut next = address;
    let mut touched = 0;
    while next < end {
        let follows = |row: &&Register| row.table == table && (row.address..row.end()).contains(&next);
        next = rows.get(touched).filter(follows).ok_or(Exception::IllegalDataAddress)?.end();
        touched += 1;
    }
    Ok(rows.iter().take(touched).map(move |row| {
        let first = row.address.max(address);
        Span { row, offset: first - row.address, count: row.end().min(end) - first }
    }))
}

impl Smsd {
    pub(super) fn read_bits(
        &self,
        now: Instant,
        session: &Session,
        table: Table,
        address: u16,
        count: u16,
    ) -> Result<Bits, Exception> {
        let mut bits = Bits::EMPTY;
        for span in spans(table, address, count)? {
            readable(span.row, session)?;
            for place in span.places() {
                let _ = bits.push(self.value(now, session, span.row.id, place.index) != 0);
            }
        }
        Ok(bits)
    }

    pub(super) fn read_words(
        &self,
        now: Instant,
        session: &Session,
        table: Table,
        address: u16,
        count: u16,
    ) -> Result<Words, Exception> {
        let mut words = Words::new();
        for span in spans(table, address, count)? {
            readable(span.row, session)?;
            for place in span.places() {
                let value = self.value(now, session, span.row.id, place.index);
                let word = (value >> self.shift(span.row, place.half)) & 0xFFFF;
                words.try_push(u16::try_from(word).unwrap_or(0)).map_err(|_| Exception::IllegalDataValue)?;
            }
        }
        Ok(words)
    }

    pub(super) fn write_coils(
        &mut self,
        now: Instant,
        session: &Session,
        address: u16,
        values: &Bits,
    ) -> Result<(), Exception> {
        let spans = spans(Table::Coils, address, values.len())?;
        for span in spans.clone() {
            writable(span.row, session)?;
        }
        let mut rest = values.iter();
        for span in spans {
            for (_, value) in span.places().zip(&mut rest) {
                self.write_coil(now, span.row.id, value);
            }
        }
        Ok(())
    }

    /// Writes holding registers: all values are checked first, then the data is taken, then the one register among
    /// them that acts (`CMD`, `Password_CMD`, `MEM_CMD`) acts on the data as it is then.
    pub(super) fn write_words(
        &mut self,
        now: Instant,
        session: &mut Session,
        address: u16,
        values: &[u16],
    ) -> Result<(), Exception> {
        let count = u16::try_from(values.len()).unwrap_or(u16::MAX);
        let spans = spans(Table::HoldingRegisters, address, count)?;
        for span in spans.clone() {
            writable(span.row, session)?;
        }
        let mut action = None;
        let mut state_allows = true;
        for (span, part) in parts(spans.clone(), values) {
            self.check_values(session, span, part)?;
            state_allows &= self.state_allows(now, span.row.writable);
            if matches!(span.row.id, Reg::Cmd | Reg::PasswordCmd | Reg::MemCmd) {
                action = part.first().map(|value| (span.row.id, *value));
            }
        }
        if !state_allows {
            return Err(Exception::ServerDeviceBusy);
        }
        let before = self.programs.registers;
        let mut parameters = None;
        for (span, part) in parts(spans, values) {
            for (place, value) in span.places().zip(part) {
                if let Some(parameter) = self.parameter(&mut parameters, span.row.id) {
                    *parameter = *value;
                } else {
                    self.take_word(now, session, span.row, place, *value);
                }
            }
        }
        if let Some(parameters) = parameters {
            self.motor.set_parameters(now, |chip| *chip = parameters);
        }
        let Some((id, value)) = action else { return Ok(()) };
        self.act(now, session, id, value).inspect_err(|_| self.programs.registers = before)
    }

    /// Whether the values that a write carries for one row may be written there. A 32-bit value of which only half is
    /// written is checked when it is used.
    fn check_values(&self, session: &Session, span: Span, values: &[u16]) -> Result<(), Exception> {
        let range = span.row.range(self.config.model);
        let within = |value: i64| (range.0..=range.1).contains(&value);
        let valid = match (span.row.kind, values) {
            (Kind::Bit | Kind::U16, [code]) if span.row.limits == Limits::Commands => {
                Opcode::from_cmd(*code).is_some()
            }
            (Kind::Bit | Kind::U16, values) => values.iter().all(|value| within(i64::from(*value))),
            (Kind::I32, [first, second]) => within(i64::from(self.join(*first, *second).cast_signed())),
            (Kind::U32 | Kind::I32, _) => true,
        };
        if !valid {
            return Err(Exception::IllegalDataValue);
        }
        let changes_password = span.row.id == Reg::PasswordCmd && values.contains(&1);
        if changes_password && !session.is_authorised() {
            return Err(Exception::IllegalDataAddress);
        }
        Ok(())
    }

    /// Whether a value is within the range of a register.
    pub(super) fn fits(&self, reg: Reg, value: u16) -> bool {
        let (min, max) = reg.info().range(self.config.model);
        (min..=max).contains(&i64::from(value))
    }

    fn state_allows(&self, now: Instant, writable: Writable) -> bool {
        match writable {
            Writable::Always => true,
            Writable::Stopped => self.motor.standing(now),
            Writable::HiZ => !self.motor.energised(),
        }
    }

    /// Lets the register that acts act.
    fn act(&mut self, now: Instant, session: &mut Session, id: Reg, value: u16) -> Result<(), Exception> {
        if id == Reg::MemCmd {
            let procedure = self.programs.plan(self.interpreter.executing())?;
            self.programs.start(now, procedure);
        } else if id == Reg::PasswordCmd && value == 0 {
            self.authorise(now, session);
        } else if id == Reg::PasswordCmd {
            self.change_password(session);
        } else if let Some(opcode) = Opcode::from_cmd(value) {
            self.command(now, opcode);
        }
        Ok(())
    }

    fn write_coil(&mut self, now: Instant, id: Reg, value: bool) {
        if id == Reg::Relay {
            self.relay = value;
        } else if id == Reg::BComplete {
            // The host may only clear it.
            self.programs.b_complete &= value;
        } else if value {
            self.trigger(now, id);
        }
    }

    fn trigger(&mut self, now: Instant, id: Reg) {
        type Act = fn(&mut Smsd, Instant);
        const TRIGGERS: [(Reg, Act); 8] = [
            (Reg::Clr, |drive, _| drive.motor.clear_flags()),
            (Reg::ResetPos, |drive, now| drive.motor.reset_position(now)),
            (Reg::ResetPowerstep01, Smsd::reset_motor_chip),
            (Reg::SoftStop, |drive, now| drive.stop(now, PowerStep01::soft_stop)),
            (Reg::HardStop, |drive, now| drive.stop(now, PowerStep01::hard_stop)),
            (Reg::SoftHiZ, |drive, now| drive.stop(now, PowerStep01::soft_hi_z)),
            (Reg::HardHiZ, |drive, now| drive.stop(now, PowerStep01::hard_hi_z)),
            (Reg::ApplyNetworkConfiguration, |drive, _| drive.apply_network_configuration()),
        ];
        if let Some((_, act)) = TRIGGERS.iter().find(|(trigger, _)| *trigger == id) {
            act(self, now);
        }
    }

    /// Stores the LAN parameters and asks the world to reach the controller by them.
    pub(super) fn apply_network_configuration(&mut self) {
        self.memory.lan = self.lan;
        self.unsaved.mark(Record::Lan);
        self.network_configured = true;
    }

    /// The parameter of the motor chip that a register holds; `None` for any other register. All that one request
    /// writes are collected in `changed`, so that the chip takes them at once and plans its motion anew once.
    #[allow(clippy::wildcard_enum_match_arm, reason = "a test writes and reads back every holding register")]
    fn parameter<'a>(&self, changed: &'a mut Option<Parameters>, id: Reg) -> Option<&'a mut u16> {
        let choose: fn(&mut Parameters) -> &mut u16 = match id {
            Reg::MinSpeed => |chip| &mut chip.min_speed,
            Reg::MaxSpeed => |chip| &mut chip.max_speed,
            Reg::Acc => |chip| &mut chip.acc,
            Reg::Dec => |chip| &mut chip.dec,
            Reg::FsSpeed => |chip| &mut chip.fs_speed,
            _ => return None,
        };
        Some(choose(changed.get_or_insert(*self.motor.parameters())))
    }

    /// Takes a checked word into its place. The parameters of the motor chip are taken together: see
    /// [`Smsd::parameter`]. The registers that act are not data: see [`Smsd::act`].
    #[allow(clippy::wildcard_enum_match_arm, reason = "a test writes and reads back every holding register")]
    fn take_word(&mut self, now: Instant, session: &mut Session, row: &Register, place: Place, word: u16) {
        let low_byte = word.to_le_bytes()[0];
        let index = usize::from(place.index);
        let shift = self.shift(row, place.half);
        match row.id {
            Reg::TargetSpeed => self.registers.target_speed = word,
            Reg::TargetPos => {
                let value = replace_word(self.registers.target_pos.cast_unsigned(), shift, word);
                self.registers.target_pos = value.cast_signed();
            }
            Reg::TargetInput => self.registers.target_input = word,
            Reg::CurrentOrVoltage => self.configure_motor(now, |mode| mode.current_or_voltage = word),
            Reg::MotorType => self.configure_motor(now, |mode| mode.motor_type = word),
            Reg::Microstepping => self.configure_motor(now, |mode| mode.microstepping = word),
            Reg::WorkCurrent => self.configure_motor(now, |mode| mode.work_current = word),
            Reg::StopCurrent => self.configure_motor(now, |mode| mode.stop_current = word),
            Reg::Mask => self.set_mask(now, low_byte),
            Reg::PasswordLow32 => session.enter(shift, word),
            Reg::PasswordHigh32 => session.enter(32 + shift, word),
            Reg::CmdBuffer => {
                if let Some(slot) = self.programs.buffer.get_mut(index) {
                    *slot = replace_word(*slot, shift, word);
                }
            }
            Reg::NProg => self.programs.registers.n_prog = word,
            Reg::NStr => self.programs.registers.n_str = word,
            Reg::SectorSize => self.programs.registers.sector_size = word,
            Reg::ProgSize => self.programs.registers.prog_size = word,
            Reg::MemCmd => self.programs.registers.mem_cmd = word,
            Reg::LanId => self.lan.id = low_byte,
            Reg::LanMac => set_octet(&mut self.lan.mac, index, low_byte),
            Reg::LanIp => set_octet(&mut self.lan.ip, index, low_byte),
            Reg::LanSubnetMask => set_octet(&mut self.lan.subnet_mask, index, low_byte),
            Reg::LanGateway => set_octet(&mut self.lan.gateway, index, low_byte),
            Reg::LanDns => set_octet(&mut self.lan.dns, index, low_byte),
            Reg::LanPort => self.lan.port = self.chosen_port(word),
            Reg::LanDhcp => self.lan.dhcp = low_byte,
            // `CMD` and `Password_CMD` act, `Wait` ignores what is written, and the rest are no holding registers.
            _ => {}
        }
    }

    /// The TCP port to remember when somebody chooses this one: none while it is the rig's.
    pub(super) fn chosen_port(&self, port: u16) -> Option<u16> {
        (port != self.config.port).then_some(port)
    }

    pub(super) fn configure_motor(&mut self, now: Instant, change: impl FnOnce(&mut MotorConfiguration)) {
        change(&mut self.memory.motor);
        self.unsaved.mark(Record::Motor);
        self.motor.set_microsteps(now, self.memory.motor.microsteps_per_step());
    }

    /// The value of a register at `now`, of a signed one its bits; `index` is its number within the row.
    #[allow(
        clippy::too_many_lines,
        clippy::match_same_arms,
        reason = "one line a register, in the order of the map"
    )]
    pub(super) fn value(&self, now: Instant, session: &Session, id: Reg, index: u16) -> u32 {
        let index = usize::from(index);
        let parameters = self.motor.parameters();
        let mode = &self.memory.motor;
        let status = || self.status(now);
        match id {
            Reg::Clr | Reg::ResetPos | Reg::ResetPowerstep01 | Reg::ApplyNetworkConfiguration => 0,
            Reg::SoftStop | Reg::HardStop | Reg::SoftHiZ | Reg::HardHiZ => 0,
            Reg::PasswordLow32 | Reg::PasswordHigh32 | Reg::PasswordCmd => 0,
            Reg::Relay => self.relay.into(),
            Reg::BComplete => self.programs.b_complete.into(),
            Reg::HiZ => status().hi_z.into(),
            Reg::Stop => (status().motion == MotStatus::Stopped).into(),
            Reg::ConstSpeed => (status().motion == MotStatus::ConstantSpeed).into(),
            Reg::AccFlag => (status().motion == MotStatus::Accelerating).into(),
            Reg::DecFlag => (status().motion == MotStatus::Decelerating).into(),
            Reg::Ready => status().ready.into(),
            Reg::SwF => status().sw_f.into(),
            Reg::SwEvn => status().sw_evn.into(),
            Reg::DirFlag => status().forward.into(),
            Reg::CmdError => status().cmd_error.into(),
            Reg::AccessFlag => session.is_authorised().into(),
            Reg::ProgramRun => self.interpreter.is_running().into(),
            Reg::NProgram => self.interpreter.place().area.into(),
            Reg::NCommand => self.interpreter.place().line.into(),
            Reg::Speed => self.motor.whole_speed(now).into(),
            Reg::AbsPos => self.motor.position(now).cast_unsigned(),
            Reg::ElPos => self.motor.el_pos(now).into(),
            Reg::StatusWord => status().word().into(),
            Reg::Inputs => self.inputs.levels().into(),
            Reg::ModeNPrograms => self.memory.mode_n_programs.into(),
            Reg::HwMajor => self.config.model.hw_major().into(),
            Reg::HwVer => HW_VER.into(),
            Reg::FwMajor => FIRMWARE.0.into(),
            Reg::FwMinor => FIRMWARE.1.into(),
            Reg::RmMajor => REGISTER_MAP.0.into(),
            Reg::RmMinor => REGISTER_MAP.1.into(),
            Reg::MinSpeed => parameters.min_speed.into(),
            Reg::MaxSpeed => parameters.max_speed.into(),
            Reg::Acc => parameters.acc.into(),
            Reg::Dec => parameters.dec.into(),
            Reg::FsSpeed => parameters.fs_speed.into(),
            Reg::TargetSpeed => self.registers.target_speed.into(),
            Reg::TargetPos => self.registers.target_pos.cast_unsigned(),
            Reg::TargetInput => self.registers.target_input.into(),
            Reg::Cmd => self.registers.cmd.into(),
            Reg::CurrentOrVoltage => mode.current_or_voltage.into(),
            Reg::MotorType => mode.motor_type.into(),
            Reg::Microstepping => mode.microstepping.into(),
            Reg::WorkCurrent => mode.work_current.into(),
            Reg::StopCurrent => mode.stop_current.into(),
            Reg::Mask => self.inputs.mask().into(),
            Reg::Wait => self.waiting().into(),
            Reg::CmdBuffer => self.programs.buffer.get(index).copied().unwrap_or(0),
            Reg::NProg => self.programs.registers.n_prog.into(),
            Reg::NStr => self.programs.registers.n_str.into(),
            Reg::SectorSize => self.programs.registers.sector_size.into(),
            Reg::ProgSize => self.programs.registers.prog_size.into(),
            Reg::MemCmd => self.programs.registers.mem_cmd.into(),
            Reg::LanId => self.lan.id.into(),
            Reg::LanMac => octet(&self.lan.mac, index),
            Reg::LanIp => octet(&self.lan.ip, index),
            Reg::LanSubnetMask => octet(&self.lan.subnet_mask, index),
            Reg::LanGateway => octet(&self.lan.gateway, index),
            Reg::LanDns => octet(&self.lan.dns, index),
            Reg::LanPort => self.lan.port.unwrap_or(self.config.port).into(),
            Reg::LanDhcp => self.lan.dhcp.into(),
        }
    }

    /// By how many bits a half of a value is shifted: 0 for its low word, 16 for its high word.
    fn shift(&self, row: &Register, half: u16) -> u32 {
        let high = (half == 1) != (self.config.word_order == WordOrder::HighFirst);
        if row.kind.width() == 2 && high { 16 } else { 0 }
    }

    /// The 32-bit value of two registers that follow each other.
    fn join(&self, first: u16, second: u16) -> u32 {
        let (low, high) = match self.config.word_order {
            WordOrder::LowFirst => (first, second),
            WordOrder::HighFirst => (second, first),
        };
        u32::from(high) << 16 | u32::from(low)
    }
}

/// The rows of a checked write, each with the values that fall on it.
fn parts(spans: impl Iterator<Item = Span>, values: &[u16]) -> impl Iterator<Item = (Span, &[u16])> {
    let mut rest = values;
    spans.map_while(move |span| {
        let (part, behind) = rest.split_at_checked(usize::from(span.count))?;
        rest = behind;
        Some((span, part))
    })
}

fn readable(row: &Register, session: &Session) -> Result<(), Exception> {
    let open = row.open && row.access == Access::Read;
    (open || session.is_authorised()).then_some(()).ok_or(Exception::IllegalDataAddress)
}

fn writable(row: &Register, session: &Session) -> Result<(), Exception> {
    (row.open || session.is_authorised()).then_some(()).ok_or(Exception::IllegalDataAddress)
}

fn replace_word(value: u32, shift: u32, word: u16) -> u32 {
    value & !(0xFFFF << shift) | u32::from(word) << shift
}

fn octet(octets: &[u8], index: usize) -> u32 {
    octets.get(index).copied().unwrap_or(0).into()
}

fn set_octet(octets: &mut [u8], index: usize, value: u8) {
    if let Some(slot) = octets.get_mut(index) {
        *slot = value;
    }
}
