//! What stands in the data of packets.

use super::packet::Packet;
use arrayvec::ArrayVec;
use stepdrive_spec::smsd::standard::{LanParameters, MAX_DATA, Words};

/// The data of a packet to be built.
///
/// Everything that is put into one fits: what did not would be left out.
#[derive(Default)]
pub(super) struct Data(ArrayVec<u8, MAX_DATA>);

impl Data {
    /// A packet with these data.
    pub(super) fn packet(&self, version: u8, packet_type: u8, id: u8) -> Packet<'_> {
        Packet { version, packet_type, id, data: &self.0 }
    }

    /// Appends bytes.
    pub(super) fn put(&mut self, bytes: &[u8]) {
        let _ = self.0.try_extend_from_slice(bytes);
    }

    /// Appends a number of 16 bits.
    pub(super) fn put_u16(&mut self, value: u16) {
        self.put(&value.to_le_bytes());
    }

    /// Appends numbers of 32 bits.
    pub(super) fn put_u32s(&mut self, values: &[u32]) {
        for value in values {
            self.put(&value.to_le_bytes());
        }
    }

    /// Appends LAN parameters, 25 bytes, or 26 when they have a unit identifier.
    pub(super) fn put_lan(&mut self, lan: &LanParameters) {
        self.put(&lan.mac);
        for octets in [lan.ip, lan.subnet_mask, lan.gateway, lan.dns] {
            self.put(&octets);
        }
        self.put_u16(lan.port);
        self.put(&[lan.dhcp]);
        self.put(lan.id.as_slice());
    }
}

/// The instruction words in these bytes, 4 each; `None` when there are too many, or some are left over.
pub(super) fn words(bytes: &[u8]) -> Option<Words> {
    let (chunks, rest) = bytes.as_chunks();
    let mut words = Words::new();
    for chunk in chunks {
        words.try_push(u32::from_le_bytes(*chunk)).ok()?;
    }
    rest.is_empty().then_some(words)
}

/// The LAN parameters in these bytes; `None` when there are not 25 or 26.
pub(super) fn lan(bytes: &[u8]) -> Option<LanParameters> {
    let (mac, rest) = bytes.split_first_chunk()?;
    let (ip, rest) = rest.split_first_chunk()?;
    let (subnet_mask, rest) = rest.split_first_chunk()?;
    let (gateway, rest) = rest.split_first_chunk()?;
    let (dns, rest) = rest.split_first_chunk()?;
    let &[low, high, dhcp, ref id @ ..] = rest else { return None };
    let id = match *id {
        [] => None,
        [id] => Some(id),
        _ => return None,
    };
    let port = u16::from_le_bytes([low, high]);
    Some(LanParameters {
        mac: *mac,
        ip: *ip,
        subnet_mask: *subnet_mask,
        gateway: *gateway,
        dns: *dns,
        port,
        dhcp,
        id,
    })
}
