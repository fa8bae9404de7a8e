//! What survives power-off, and how it is written down.

use arrayvec::ArrayVec;
use core::fmt;
use stepdrive_spec::smsd::instructions::{PROGRAM_AREAS, PROGRAM_LINES};
use stepdrive_spec::smsd::mode::MotorConfiguration;
use stepdrive_spec::smsd::registers::Reg;

/// The LAN parameters (App. A, 0x7000 to 0x7018).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lan {
    /// Modbus unit identifier, 1 to 247.
    pub id: u8,
    /// MAC address.
    pub mac: [u8; 6],
    /// IP address. The virtual controller remembers it; it is reached where its rig says.
    pub ip: [u8; 4],
    /// Subnet mask.
    pub subnet_mask: [u8; 4],
    /// Gateway.
    pub gateway: [u8; 4],
    /// DNS server.
    pub dns: [u8; 4],
    /// TCP port; `None` while nobody has chosen one, and the rig's counts.
    pub port: Option<u16>,
    /// 1 static, 2 DHCP.
    pub dhcp: u8,
}

impl Lan {
    /// As it leaves the factory (App. A; first octet of the MAC as there, since ch. 2's would be a multicast address).
    pub const FACTORY: Lan = Lan {
        id: 1,
        mac: [0x00, 0xF8, 0xDC, 0x3F, 0x00, 0x00],
        ip: [192, 168, 1, 2],
        subnet_mask: [255, 255, 0, 0],
        gateway: [192, 168, 1, 1],
        dns: [0, 0, 0, 0],
        port: None,
        dhcp: 1,
    };
}

/// A memory area for a user program. Content and size are separate (decision 11).
#[derive(Clone, PartialEq, Eq)]
pub struct Area {
    words: [u32; PROGRAM_LINES],
    size: u8,
}

impl Area {
    /// An erased area: all END, size 0.
    pub const ERASED: Area = Area { words: [0; PROGRAM_LINES], size: 0 };

    /// All 255 instruction words.
    pub fn words(&self) -> &[u32; PROGRAM_LINES] {
        &self.words
    }

    /// The size of the program: how many instructions it counts, 0 to 255.
    pub fn size(&self) -> u8 {
        self.size
    }

    pub(super) fn write(&mut self, first: usize, words: &[u32]) {
        for (slot, word) in self.words.iter_mut().skip(first).zip(words) {
            *slot = *word;
        }
    }

    pub(super) fn erase(&mut self) {
        *self = Area::ERASED;
    }

    pub(super) fn set_size(&mut self, size: u8) {
        self.size = size;
    }
}

impl fmt::Debug for Area {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let used = self.words.get(..usize::from(self.size)).unwrap_or(&self.words);
        f.debug_struct("Area").field("size", &self.size).field("words", &used).finish()
    }
}

/// The non-volatile memory of a controller.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Memory {
    /// The password, 64 bits.
    pub password: u64,
    /// The motor configuration.
    pub motor: MotorConfiguration,
    /// The LAN parameters in effect.
    pub lan: Lan,
    /// `MODE_N_PROGRAMS`: the program that autonomous mode runs, 0 to 3.
    pub mode_n_programs: u8,
    areas: [Area; PROGRAM_AREAS],
}

impl Memory {
    /// As it leaves the factory.
    pub fn factory() -> Memory {
        Memory {
            password: factory_password(),
            motor: MotorConfiguration::FACTORY,
            lan: Lan::FACTORY,
            mode_n_programs: 0,
            areas: [Area::ERASED; PROGRAM_AREAS],
        }
    }

    /// Memory area 0 to 3; a higher number gives the last.
    pub fn area(&self, number: usize) -> &Area {
        let [.., last] = &self.areas;
        self.areas.get(number).unwrap_or(last)
    }

    /// Puts a whole program into memory area 0 to 3, and sets its size. Words past the 255th are cut off.
    pub fn load_program(&mut self, area: usize, words: &[u32]) {
        let area = self.area_mut(area);
        area.erase();
        area.write(0, words);
        area.set_size(u8::try_from(words.len()).unwrap_or(u8::MAX));
    }

    pub(super) fn area_mut(&mut self, number: usize) -> &mut Area {
        let [first, second, third, last] = &mut self.areas;
        match number {
            0 => first,
            1 => second,
            2 => third,
            _ => last,
        }
    }

    /// A record as bytes, little-endian, as it is to be stored.
    pub fn encode(&self, record: Record) -> RecordBytes {
        let mut bytes = RecordBytes::new();
        let mut put = |part: &[u8]| bytes.extend(part.iter().copied().take(part.len().min(RECORD_SIZE)));
        match record {
            Record::Password => put(&self.password.to_le_bytes()),
            Record::Motor => put(&self.motor.data().to_le_bytes()),
            Record::ModeNPrograms => put(&[self.mode_n_programs]),
            Record::Lan => {
                let lan = &self.lan;
                put(&[lan.id, lan.dhcp]);
                put(&lan.port.unwrap_or(0).to_le_bytes());
                put(&lan.mac);
                for address in [lan.ip, lan.subnet_mask, lan.gateway, lan.dns] {
                    put(&address);
                }
            }
            Record::Program(number) => {
                let area = self.area(usize::from(number));
                put(&[area.size]);
                for word in &area.words {
                    put(&word.to_le_bytes());
                }
            }
        }
        bytes
    }

    /// Takes a record over from its bytes.
    ///
    /// # Errors
    /// When they are not what [`Memory::encode`] makes; the memory is as it was then.
    pub fn decode(&mut self, record: Record, bytes: &[u8]) -> Result<(), DamagedRecord> {
        self.take(record, bytes).ok_or(DamagedRecord(record))
    }

    fn take(&mut self, record: Record, bytes: &[u8]) -> Option<()> {
        match record {
            Record::Password => self.password = u64::from_le_bytes(*whole(bytes)?),
            Record::Motor => {
                let data = u32::from_le_bytes(*whole(bytes)?);
                let motor = MotorConfiguration::from_data(data);
                self.motor = (motor.data() == data).then_some(motor)?;
            }
            Record::ModeNPrograms => {
                let [number] = *whole(bytes)?;
                self.mode_n_programs = (usize::from(number) < PROGRAM_AREAS).then_some(number)?;
            }
            Record::Lan => self.lan = lan_from_bytes(bytes)?,
            Record::Program(number) => *self.area_mut(usize::from(number)) = area_from_bytes(bytes)?,
        }
        Some(())
    }
}

/// The password as it leaves the factory.
pub(super) fn factory_password() -> u64 {
    let half = |reg: Reg| u64::from(u32::try_from(reg.info().default).unwrap_or(0));
    half(Reg::PasswordHigh32) << 32 | half(Reg::PasswordLow32)
}

fn lan_from_bytes(mut bytes: &[u8]) -> Option<Lan> {
    let [id, dhcp] = *split(&mut bytes)?;
    let port = u16::from_le_bytes(*split(&mut bytes)?);
    let lan = Lan {
        id,
        dhcp,
        port: (port != 0).then_some(port),
        mac: *split(&mut bytes)?,
        ip: *split(&mut bytes)?,
        subnet_mask: *split(&mut bytes)?,
        gateway: *split(&mut bytes)?,
        dns: *split(&mut bytes)?,
    };
    let valid = (1..=247).contains(&id) && (1..=2).contains(&dhcp) && bytes.is_empty();
    valid.then_some(lan)
}

fn area_from_bytes(mut bytes: &[u8]) -> Option<Area> {
    let [size] = *split(&mut bytes)?;
    let mut area = Area { size, ..Area::ERASED };
    for word in &mut area.words {
        *word = u32::from_le_bytes(*split(&mut bytes)?);
    }
    bytes.is_empty().then_some(area)
}

fn whole<const N: usize>(bytes: &[u8]) -> Option<&[u8; N]> {
    bytes.try_into().ok()
}

fn split<'a, const N: usize>(rest: &mut &'a [u8]) -> Option<&'a [u8; N]> {
    let (part, behind) = rest.split_first_chunk()?;
    *rest = behind;
    Some(part)
}

/// The largest record: the size and the words of a memory area.
const RECORD_SIZE: usize = 1 + 4 * PROGRAM_LINES;

/// The bytes of a record.
pub type RecordBytes = ArrayVec<u8, RECORD_SIZE>;

/// A part of the memory that is stored as one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Record {
    /// The password.
    Password,
    /// The motor configuration.
    Motor,
    /// The LAN parameters.
    Lan,
    /// `MODE_N_PROGRAMS`.
    ModeNPrograms,
    /// The memory area with this number, 0 to 3.
    Program(u8),
}

impl Record {
    /// All of them.
    pub const ALL: [Record; 8] = [
        Record::Password,
        Record::Motor,
        Record::Lan,
        Record::ModeNPrograms,
        Record::Program(0),
        Record::Program(1),
        Record::Program(2),
        Record::Program(3),
    ];

    /// The record's name in a store: stable, lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Record::Password => "password",
            Record::Motor => "motor",
            Record::Lan => "lan",
            Record::ModeNPrograms => "mode_n_programs",
            Record::Program(0) => "program0",
            Record::Program(1) => "program1",
            Record::Program(2) => "program2",
            Record::Program(_) => "program3",
        }
    }
}

/// A record whose bytes make no sense.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DamagedRecord(pub Record);

impl fmt::Display for DamagedRecord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the stored record `{}` is damaged", self.0.name())
    }
}

impl core::error::Error for DamagedRecord {}

/// Which records have changed and wait to be stored.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Unsaved {
    /// A bit for each of [`Record::ALL`].
    records: u8,
    generation: u64,
}

impl Unsaved {
    pub(super) fn mark(&mut self, record: Record) {
        self.records |= bit(record);
        self.generation = self.generation.saturating_add(1);
    }

    pub(super) fn mark_program(&mut self, area: usize) {
        self.mark(Record::Program(u8::try_from(area).unwrap_or(u8::MAX)));
    }

    pub(super) fn generation(self) -> u64 {
        self.generation
    }

    pub(super) fn take(&mut self) -> Option<Record> {
        let record = Record::ALL.into_iter().find(|record| self.records & bit(*record) != 0)?;
        self.records &= !bit(record);
        Some(record)
    }
}

fn bit(record: Record) -> u8 {
    match record {
        Record::Password => 1,
        Record::Motor => 1 << 1,
        Record::Lan => 1 << 2,
        Record::ModeNPrograms => 1 << 3,
        Record::Program(0) => 1 << 4,
        Record::Program(1) => 1 << 5,
        Record::Program(2) => 1 << 6,
        Record::Program(_) => 1 << 7,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn used_memory() -> Memory {
        let mut memory = Memory::factory();
        memory.password = 0xFEDC_BA98_7654_3210;
        memory.motor.microstepping = 7;
        memory.lan.port = Some(6000);
        memory.lan.id = 9;
        memory.mode_n_programs = 2;
        memory.area_mut(3).write(253, &[0x0001_9060, 0x10, 0x20]);
        memory.area_mut(3).set_size(255);
        memory
    }

    #[test]
    fn every_record_survives_being_written_down() {
        let memory = used_memory();
        let mut restored = Memory::factory();
        for record in Record::ALL {
            restored.decode(record, &memory.encode(record)).expect("intact");
        }
        assert_eq!(restored, memory);
    }

    #[test]
    fn a_record_cut_short_or_grown_is_damaged_and_changes_nothing() {
        let memory = used_memory();
        for record in Record::ALL {
            let bytes = memory.encode(record);
            for end in 0..bytes.len() {
                let mut restored = Memory::factory();
                let cut = bytes.get(..end).expect("within");
                assert_eq!(restored.decode(record, cut), Err(DamagedRecord(record)), "{record:?} {end}");
                assert_eq!(restored, Memory::factory(), "{record:?} {end}");
            }
        }
    }

    #[test]
    fn each_changed_record_is_named_once() {
        let mut unsaved = Unsaved::default();
        unsaved.mark(Record::Lan);
        unsaved.mark_program(2);
        unsaved.mark(Record::Lan);
        assert_eq!(unsaved.generation(), 3);
        assert_eq!(unsaved.take(), Some(Record::Lan));
        assert_eq!(unsaved.take(), Some(Record::Program(2)));
        assert_eq!(unsaved.take(), None);
    }

    #[test]
    fn writing_past_the_last_line_of_an_area_is_cut_off() {
        let mut memory = Memory::factory();
        memory.area_mut(0).write(254, &[1 << 4, 2 << 4]);
        assert_eq!(memory.area(0).words()[254], 1 << 4);
    }
}
