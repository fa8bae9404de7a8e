//! What a rig file says of an SMSD, checked.

use super::checked::{Mistake, check_foreign, span, value};
use super::written::WrittenDrive;
use super::{LanSection, SmsdSection};
use alloc::string::ToString;
use core::ops::Range;
use stepdrive_drive::smsd::WordOrder;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::standard::{Firmware, VERSION_2};

impl WrittenDrive {
    /// What the drive means, an SMSD.
    pub(super) fn check_smsd(&self, model: Model) -> Result<SmsdSection, Mistake> {
        let foreign = [
            ("serial", span(self.serial.as_ref())),
            ("serial_tcp", span(self.serial_tcp.as_ref())),
            ("winding", span(self.winding.as_ref())),
        ];
        check_foreign(foreign, "an SMSD")?;
        Ok(SmsdSection {
            model,
            lan: self.check_lan()?,
            usb: self.usb.as_ref().map(|usb| usb.get_ref().clone()),
            usb_tcp: value(self.usb_tcp.as_ref()),
            protocol_version: value(self.protocol_version.as_ref()).unwrap_or(VERSION_2),
            word_order: value(self.word_order.as_ref()).unwrap_or(WordOrder::LowFirst),
            autonomous: value(self.autonomous.as_ref()).unwrap_or(false),
            mode_n_programs: value(self.mode_n_programs.as_ref()),
            switches: self.check_switches(Input::from_name, &Input::ALL.map(Input::name))?,
        })
    }

    /// Where it listens, which depends on what it speaks there.
    fn check_lan(&self) -> Result<LanSection, Mistake> {
        let firmware = value(self.lan.as_ref()).unwrap_or_default();
        let address = match firmware {
            Firmware::Modbus => {
                refuse(
                    span(self.standard_tcp.as_ref()),
                    "standard_tcp is for lan = \"standard\" alone; give that too, or modbus_tcp instead of it",
                )?;
                self.modbus_tcp.as_ref().ok_or_else(|| {
                    self.at_name(
                        "an SMSD needs an address to listen on, as in modbus_tcp = \"127.0.0.1:5020\"",
                    )
                })
            }
            Firmware::Standard => {
                refuse(
                    span(self.modbus_tcp.as_ref()),
                    "modbus_tcp is not for lan = \"standard\", which has no Modbus; it has standard_tcp instead",
                )?;
                refuse(
                    span(self.word_order.as_ref()),
                    "word_order is not for lan = \"standard\", which has no Modbus registers",
                )?;
                self.standard_tcp.as_ref().ok_or_else(|| {
                    self.at_name(
                        "with lan = \"standard\" an SMSD needs an address to listen on, as in standard_tcp = \
                         \"127.0.0.1:5000\"",
                    )
                })
            }
        };
        address.map(|address| LanSection { firmware, address: *address.get_ref() })
    }

    fn at_name(&self, message: &str) -> Mistake {
        (self.name.span(), message.to_string())
    }
}

/// A key that stands where it cannot.
fn refuse(key: Option<Range<usize>>, message: &str) -> Result<(), Mistake> {
    key.map_or(Ok(()), |span| Err((span, message.to_string())))
}
