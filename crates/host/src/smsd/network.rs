//! LAN parameters (App. A).

use super::client::SmsdClient;
use super::driver::Smsd;
use super::snapshot::between;
use super::value::{Run, Slot, range};
use crate::Error;
use stepdrive_spec::smsd::registers::Reg;

/// Value of `DHCP`: the address is static.
pub(super) const STATIC: u8 = 1;
/// Value of `DHCP`: the address comes from a DHCP server.
pub(super) const FROM_SERVER: u8 = 2;

/// The LAN parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LanParameters {
    /// Modbus unit identifier, 1 to 247; `None` where the controller has none, and to leave it as it is.
    pub id: Option<u8>,
    /// MAC address.
    pub mac: [u8; 6],
    /// IP address.
    pub ip: [u8; 4],
    /// Subnet mask.
    pub subnet_mask: [u8; 4],
    /// Gateway.
    pub gateway: [u8; 4],
    /// DNS server.
    pub dns: [u8; 4],
    /// TCP port, not 0.
    pub port: u16,
    /// The address comes from a DHCP server.
    pub dhcp: bool,
}

impl SmsdClient {
    /// The LAN parameters as they are written down, in one request. They are in effect if they were applied since.
    ///
    /// # Errors
    /// Those of [`SmsdClient::read_at`]; [`Error::Device`] when one of them is out of its range.
    pub async fn lan_parameters(&self) -> Result<LanParameters, Error> {
        let slots = parameters();
        let values = self.read_run(Run { slots: &slots }).await?;
        if let Some((slot, value)) = slots.iter().zip(&values).find(|(slot, value)| !can_be(slot, **value)) {
            return Err(out_of_range(slot, *value, &self.name().await));
        }
        let value = |reg: Reg, index: u16| {
            let mut found = slots.iter().zip(&values);
            found.find(|(slot, _)| slot.row.id == reg && slot.index == index).map_or(0, |(_, value)| *value)
        };
        let octet = |reg: Reg, index: u16| u8::try_from(value(reg, index)).unwrap_or(u8::MAX);
        let address = |reg: Reg| [0, 1, 2, 3].map(|index| octet(reg, index));
        Ok(LanParameters {
            id: Some(octet(Reg::LanId, 0)),
            mac: [0, 1, 2, 3, 4, 5].map(|index| octet(Reg::LanMac, index)),
            ip: address(Reg::LanIp),
            subnet_mask: address(Reg::LanSubnetMask),
            gateway: address(Reg::LanGateway),
            dns: address(Reg::LanDns),
            port: u16::try_from(value(Reg::LanPort, 0)).unwrap_or(0),
            dhcp: value(Reg::LanDhcp, 0) == i64::from(FROM_SERVER),
        })
    }

    /// Writes the LAN parameters down, all in one request, and reads them back. They take effect, and survive power-off,
    /// only when they are applied.
    ///
    /// # Errors
    /// Those of [`SmsdClient::write_at`]; [`Error::Differs`] when they do not read back as they were written.
    pub async fn set_lan_parameters(&self, lan: &LanParameters) -> Result<(), Error> {
        let named = |slot: &Slot| slot.row.id != Reg::LanId || lan.id.is_some();
        let values = parameters().into_iter().filter(named).map(|slot| (slot, value_of(lan, slot)));
        self.write_slots(values.collect()).await?;
        let found = self.lan_parameters().await?;
        if found == (LanParameters { id: lan.id.or(found.id), ..*lan }) {
            return Ok(());
        }
        Err(differ(lan, &found))
    }

    /// Stores the LAN parameters and puts them into effect: the controller closes all connections. From then on this
    /// client asks for the unit that they name, unless it uses 0 or 255, which every controller answers; a controller
    /// that is now at another address needs another client.
    ///
    /// # Errors
    /// Those of [`SmsdClient::trigger`].
    pub async fn apply_lan_parameters(&self) -> Result<(), Error> {
        let id = self.read(Reg::LanId).await?;
        self.trigger(Reg::ApplyNetworkConfiguration).await?;
        let mut session = self.session.lock().await;
        session.wire.close();
        if let Some(id) = u8::try_from(id).ok().filter(|_| !matches!(session.unit(), 0 | u8::MAX)) {
            session.set_unit(id);
        }
        Ok(())
    }
}

/// A parameter of the controller `name` reads as what it cannot be.
pub(super) fn out_of_range(slot: &Slot, value: i64, name: &str) -> Error {
    let takes = slot.takes(None);
    Error::Device(format!("{slot} of {name} reads {value}, and it can be {takes}; write another value to it"))
}

/// The parameters do not read as they were written.
pub(super) fn differ(written: &LanParameters, found: &LanParameters) -> Error {
    Error::Differs(format!("the LAN parameters were written as {written:?} and read {found:?}"))
}

fn parameters() -> Vec<Slot> {
    between(Reg::LanId, Reg::LanDhcp)
}

/// Whether a register may hold a value.
fn can_be(slot: &Slot, value: i64) -> bool {
    let (lowest, highest) = range(slot.row, None);
    (lowest..=highest).contains(&value)
}

fn value_of(lan: &LanParameters, slot: Slot) -> i64 {
    let octet = |octets: &[u8]| octets.get(usize::from(slot.index)).copied().unwrap_or(0).into();
    let rows: [(Reg, i64); 8] = [
        (Reg::LanId, lan.id.map_or(0, i64::from)),
        (Reg::LanMac, octet(&lan.mac)),
        (Reg::LanIp, octet(&lan.ip)),
        (Reg::LanSubnetMask, octet(&lan.subnet_mask)),
        (Reg::LanGateway, octet(&lan.gateway)),
        (Reg::LanDns, octet(&lan.dns)),
        (Reg::LanPort, lan.port.into()),
        (Reg::LanDhcp, i64::from(if lan.dhcp { FROM_SERVER } else { STATIC })),
    ];
    rows.iter().find(|(reg, _)| *reg == slot.row.id).map_or(0, |(_, value)| *value)
}
