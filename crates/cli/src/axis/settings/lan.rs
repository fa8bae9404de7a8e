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
    /// Modbus unit identifier, 1 to 247.
    id: Spanned<u8>,
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
        if !(1..=247).contains(self.id.get_ref()) {
            return Err((self.id.span(), format!("id takes 1 to 247, not {}", self.id.get_ref())));
        }
        if *self.port.get_ref() == 0 {
            return Err((self.port.span(), "port takes 1 to 65535, not 0".to_owned()));
        }
        Ok(LanParameters {
            id: *self.id.get_ref(),
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
pub(super) fn rows(lan: &LanParameters) -> [(&'static str, String); 7] {
    let address = |octets: [u8; 4]| format!("\"{}\"", Ipv4Addr::from(octets));
    [
        ("id", lan.id.to_string()),
        ("ip", address(lan.ip)),
        ("subnet_mask", address(lan.subnet_mask)),
        ("gateway", address(lan.gateway)),
        ("dns", address(lan.dns)),
        ("port", lan.port.to_string()),
        ("dhcp", lan.dhcp.to_string()),
    ]
}

/// The part of a profile.
pub(super) fn lan_text(lan: &LanParameters) -> String {
    let lines = rows(lan).map(|(name, value)| format!("{name} = {value}\n"));
    format!(
        "\n# Applied only with --lan: the controller is reached there afterwards.\n[lan]\n{}",
        lines.concat()
    )
}

/// What is not the same: the name, the value in the file, and that in the controller.
pub(super) fn differences(file: &LanParameters, now: &LanParameters) -> Vec<(&'static str, String, String)> {
    let pairs = rows(file).into_iter().zip(rows(now));
    pairs
        .filter(|((_, file), (_, now))| file != now)
        .map(|((name, file), (_, now))| (name, file, now))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAN: LanParameters = LanParameters {
        id: 3,
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
        assert_eq!(read(&lan_text(&LAN)), Ok(LanParameters { mac: [0; 6], ..LAN }));
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
        let told = differences(&LAN, &LanParameters { port: 1502, ..LAN });
        assert_eq!(told, [("port", "502".to_owned(), "1502".to_owned())]);
    }
}
