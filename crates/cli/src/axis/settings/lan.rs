//! The LAN parameters of an SMSD in a profile: `[lan]`.

use super::profile::Misplaced;
use serde::Deserialize;
use std::net::Ipv4Addr;
use stepdrive_host::smsd::LanParameters;
use toml::Spanned;

/// `[lan]` as it is written. The MAC address is the controller's own and stands in no profile.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WrittenLan {
    /// Modbus unit identifier, 1 to 247; left out for a controller with the standard firmware, which has none.
    id: Option<Spanned<u8>>,
    ip: Ipv4Addr,
    subnet_mask: Ipv4Addr,
    gateway: Ipv4Addr,
    dns: Ipv4Addr,
    /// TCP port, not 0.
    port: Spanned<u16>,
    /// The address comes from a DHCP server.
    dhcp: bool,
}

impl WrittenLan {
    /// The parameters, without a MAC address.
    pub(super) fn check(&self) -> Result<LanParameters, Misplaced> {
        if let Some(id) = self.id.as_ref().filter(|id| !(1..=247).contains(id.get_ref())) {
            return Err((id.span(), format!("id takes 1 to 247, not {}", id.get_ref())));
        }
        if *self.port.get_ref() == 0 {
            return Err((self.port.span(), "port takes 1 to 65535, not 0".to_owned()));
        }
        Ok(LanParameters {
            id: self.id.as_ref().map(|id| *id.get_ref()),
            mac: [0; 6],
            ip: self.ip.octets(),
            subnet_mask: self.subnet_mask.octets(),
            gateway: self.gateway.octets(),
            dns: self.dns.octets(),
            port: *self.port.get_ref(),
            dhcp: self.dhcp,
        })
    }
}

/// Their names and values, as they stand in a profile.
pub(super) fn rows(lan: &LanParameters) -> Vec<(&'static str, String)> {
    let address = |octets: [u8; 4]| format!("\"{}\"", Ipv4Addr::from(octets));
    let id = lan.id.map(|id| ("id", id.to_string()));
    let others = [
        ("ip", address(lan.ip)),
        ("subnet_mask", address(lan.subnet_mask)),
        ("gateway", address(lan.gateway)),
        ("dns", address(lan.dns)),
        ("port", lan.port.to_string()),
        ("dhcp", lan.dhcp.to_string()),
    ];
    id.into_iter().chain(others).collect()
}

/// The part of a profile.
pub(super) fn lan_text(lan: &LanParameters) -> String {
    let lines: Vec<String> = rows(lan).iter().map(|(name, value)| format!("{name} = {value}\n")).collect();
    format!(
        "\n# Applied only with --lan: the controller is reached there afterwards.\n[lan]\n{}",
        lines.concat()
    )
}

/// What is not the same: the name, the value in the file, and that in the controller. What only one of them has is none.
pub(super) fn differences(file: &LanParameters, now: &LanParameters) -> Vec<(&'static str, String, String)> {
    let now = rows(now);
    let both = rows(file).into_iter().filter_map(|(name, file)| {
        let (_, now) = now.iter().find(|(other, _)| *other == name)?;
        Some((name, file, now.clone()))
    });
    both.filter(|(_, file, now)| file != now).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAN: LanParameters = LanParameters {
        id: Some(3),
        mac: [0, 1, 2, 3, 4, 5],
        ip: [192, 168, 1, 2],
        subnet_mask: [255, 255, 0, 0],
        gateway: [192, 168, 1, 1],
        dns: [0; 4],
        port: 502,
        dhcp: false,
    };

    #[derive(Debug, Deserialize)]
    struct Only {
        lan: WrittenLan,
    }

    fn read(text: &str) -> Result<LanParameters, Misplaced> {
        toml::from_str::<Only>(text).expect("TOML").lan.check()
    }

    #[test]
    fn what_is_written_is_read_but_for_the_mac_address() {
        for lan in [LAN, LanParameters { id: None, ..LAN }] {
            assert_eq!(read(&lan_text(&lan)), Ok(LanParameters { mac: [0; 6], ..lan }));
        }
    }

    #[test]
    fn a_unit_or_port_that_there_is_not_is_a_mistake() {
        let text = lan_text(&LAN);
        assert!(read(&text.replace("id = 3", "id = 0")).is_err());
        assert!(read(&text.replace("port = 502", "port = 0")).is_err());
    }

    #[test]
    fn only_what_differs_is_told() {
        assert_eq!(differences(&LAN, &LanParameters { mac: [9; 6], ..LAN }), []);
        assert_eq!(differences(&LAN, &LanParameters { id: None, ..LAN }), []);
        let told = differences(&LAN, &LanParameters { port: 1502, ..LAN });
        assert_eq!(told, [("port", "502".to_owned(), "1502".to_owned())]);
    }
}
