//! The LAN parameters of an SMSD, as texts. They are written down when they are set, and in effect when that is asked for.

use super::rows::Row;
use serde_json::Value;
use std::net::Ipv4Addr;
use stepdrive_host::Error;
use stepdrive_host::smsd::{LanParameters, Smsd};
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::STANDARD_PORT;

/// A LAN parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Parameter {
    Id,
    Mac,
    Ip,
    SubnetMask,
    Gateway,
    Dns,
    Port,
    Dhcp,
}

impl Parameter {
    pub(super) const ALL: [Parameter; 8] = [
        Parameter::Id,
        Parameter::Mac,
        Parameter::Ip,
        Parameter::SubnetMask,
        Parameter::Gateway,
        Parameter::Dns,
        Parameter::Port,
        Parameter::Dhcp,
    ];

    /// The parameter of this name.
    pub(super) fn named(name: &str) -> Option<Parameter> {
        Parameter::ALL.into_iter().find(|one| one.name().eq_ignore_ascii_case(name))
    }

    const fn reg(self) -> Reg {
        match self {
            Parameter::Id => Reg::LanId,
            Parameter::Mac => Reg::LanMac,
            Parameter::Ip => Reg::LanIp,
            Parameter::SubnetMask => Reg::LanSubnetMask,
            Parameter::Gateway => Reg::LanGateway,
            Parameter::Dns => Reg::LanDns,
            Parameter::Port => Reg::LanPort,
            Parameter::Dhcp => Reg::LanDhcp,
        }
    }

    /// The maker's name, without the number of an octet.
    pub(super) fn name(self) -> &'static str {
        self.reg().info().name.trim_end_matches(" {}")
    }

    /// It as it is written down; `None` where the controller has none.
    pub(super) fn text(self, lan: &LanParameters) -> Option<String> {
        let address = |octets: [u8; 4]| Some(Ipv4Addr::from(octets).to_string());
        match self {
            Parameter::Id => lan.id.map(|id| id.to_string()),
            Parameter::Mac => Some(lan.mac.map(|octet| format!("{octet:02X}")).join(":")),
            Parameter::Ip => address(lan.ip),
            Parameter::SubnetMask => address(lan.subnet_mask),
            Parameter::Gateway => address(lan.gateway),
            Parameter::Dns => address(lan.dns),
            Parameter::Port => Some(lan.port.to_string()),
            // As the register has it: 1 is a static address.
            Parameter::Dhcp => Some(if lan.dhcp { "2" } else { "1" }.to_owned()),
        }
    }

    /// A value that it can have, as a text.
    pub(super) fn check(self, value: &Value) -> Result<String, String> {
        let text = match value {
            Value::String(text) => text.trim().to_owned(),
            Value::Number(number) => number.to_string(),
            Value::Null | Value::Bool(_) | Value::Array(_) | Value::Object(_) => String::new(),
        };
        match self {
            Parameter::Mac => Err("is the controller's own, and is left as it is".to_owned()),
            Parameter::Ip | Parameter::SubnetMask | Parameter::Gateway | Parameter::Dns => {
                let address: Result<Ipv4Addr, _> = text.parse();
                address
                    .map(|address| address.to_string())
                    .map_err(|_| "takes an address, as in 192.168.1.2".to_owned())
            }
            Parameter::Id | Parameter::Port | Parameter::Dhcp => {
                let (min, max) = self.range();
                let number = text.parse::<i64>().ok().filter(|number| (min..=max).contains(number));
                number.map(|number| number.to_string()).ok_or_else(|| format!("takes {min} to {max}"))
            }
        }
    }

    fn range(self) -> (i64, i64) {
        // It is the same on all models.
        self.reg().info().range(stepdrive_spec::smsd::models::Model::Smsd42)
    }

    /// It as it is shown.
    pub(super) fn row(self, lan: &LanParameters) -> Option<Row> {
        let info = self.reg().info();
        let value = self.text(lan)?;
        let is_number = info.count == 1;
        let is_standard = lan.id.is_none();
        let default =
            if self == Parameter::Port && is_standard { STANDARD_PORT.into() } else { info.default };
        let as_json = |text: String| match text.parse::<i64>().ok().filter(|_| is_number) {
            Some(number) => number.into(),
            None => Value::String(text),
        };
        let range = is_number.then(|| self.range());
        let is_fixed = self == Parameter::Mac;
        Some(Row {
            name: self.name(),
            group: "LAN",
            about: info.about,
            unit: "",
            kind: if is_number { "integer" } else { "text" },
            min: range.map(|(min, _)| min as f64),
            max: range.map(|(_, max)| max as f64),
            choices: Vec::new(),
            default: if is_number { default.into() } else { Value::Null },
            at_default: is_number.then(|| value == default.to_string()),
            stored: Value::Null,
            value: as_json(value),
            writable: !is_fixed,
            why_not: is_fixed.then(|| "it is the controller's own".to_owned()),
            volatile: false,
            source: info.source,
        })
    }
}

/// The values of the registers for a text that was checked: a number, or numbers with dots between.
fn values(text: &str) -> impl Iterator<Item = i64> {
    text.split('.').map(|part| part.parse().unwrap_or(0))
}

/// Writes down what is to be another than it is.
pub(super) async fn write(
    client: &dyn Smsd,
    wanted: &[(Parameter, String)],
    now: &LanParameters,
) -> Result<(), Error> {
    for (parameter, text) in wanted.iter().filter(|(one, text)| one.text(now).as_ref() != Some(text)) {
        for (index, value) in (0..).zip(values(text)) {
            client.write_at(parameter.reg(), index, value).await?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    const LAN: LanParameters = LanParameters {
        id: Some(3),
        mac: [0, 1, 2, 3, 4, 0xAB],
        ip: [192, 168, 1, 2],
        subnet_mask: [255, 255, 0, 0],
        gateway: [192, 168, 1, 1],
        dns: [0; 4],
        port: 502,
        dhcp: false,
    };

    #[test]
    fn what_is_shown_can_be_set_again_but_for_the_mac_address() {
        for parameter in Parameter::ALL {
            let text = parameter.text(&LAN).expect("a text");
            let checked = parameter.check(&json!(text));
            assert_eq!(checked.is_ok(), parameter != Parameter::Mac, "{parameter:?}");
            assert_eq!(Parameter::named(parameter.name()), Some(parameter));
            assert!(checked.is_err() || checked == Ok(text));
        }
        assert_eq!(Parameter::Mac.text(&LAN).as_deref(), Some("00:01:02:03:04:AB"));
    }

    #[test]
    fn what_it_cannot_be_is_refused() {
        for (parameter, value, told) in [
            (Parameter::Ip, json!("1.2.3"), "takes an address, as in 192.168.1.2"),
            (Parameter::Ip, json!(5), "takes an address, as in 192.168.1.2"),
            (Parameter::Id, json!(0), "takes 1 to 247"),
            (Parameter::Port, json!("many"), "takes 1 to 65535"),
            (Parameter::Dhcp, json!(true), "takes 1 to 2"),
        ] {
            assert_eq!(parameter.check(&value), Err(told.to_owned()), "{parameter:?}");
        }
        assert_eq!(Parameter::Id.check(&json!(7)), Ok("7".to_owned()));
    }
}
