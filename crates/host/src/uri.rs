//! Where a controller is: targets by URI.
//!
//! | | |
//! |---|---|
//! | `smsd+tcp://HOST:502?unit=1&word_order=low-first` | an SMSD over Modbus TCP; port, unit and word order may be left out |
//! | `smsd+usb:///dev/ttyACM0` | an SMSD at its USB port |
//! | `smsd+usb+tcp://HOST:PORT` | an SMSD whose USB port comes over TCP |
//! | `smsd+std://HOST:5000` | an SMSD with the standard firmware; the port may be left out |
//! | `smd3+serial:///dev/ttyACM0` | an SMD3 at a serial port |
//! | `smd3+tcp://HOST:PORT` | an SMD3 whose lines come over TCP |
//! | `HOST:PORT`, `HOST:PORT?unit=1` | an SMSD |
//! | `/dev/ttyACM0`, `COM3` | an SMD3 |
//!
//! A password never stands in a target: what is typed is seen by others and kept in histories.

use crate::connect::{Connect, Tcp};
use crate::error::Error;
use crate::serial::Serial;
use crate::smsd::{Framing, Smsd, SmsdClient, SmsdOptions, SmsdUsbClient, WordOrder};
use crate::units::shown;
use std::fmt;
use stepdrive_spec::smsd::standard::STANDARD_PORT;

/// The port of Modbus TCP.
pub const MODBUS_PORT: u16 = 502;
/// The unit that an SMSD is as it leaves the factory.
pub const DEFAULT_UNIT: u8 = 1;

const SMSD_TCP: &str = "smsd+tcp";
const SMSD_USB: &str = "smsd+usb";
const SMSD_USB_TCP: &str = "smsd+usb+tcp";
const SMSD_STANDARD: &str = "smsd+std";
const SMD3_SERIAL: &str = "smd3+serial";
const SMD3_TCP: &str = "smd3+tcp";

/// A controller's place. It displays as its URI, which is read as the same target.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// An SMSD over Modbus TCP.
    Smsd {
        /// Name or address, an IPv6 address without brackets.
        host: String,
        /// TCP port.
        port: u16,
        /// Unit identifier.
        unit: u8,
        /// Which word of a 32-bit value comes first; `None` finds out.
        word_order: Option<WordOrder>,
    },
    /// An SMSD at its USB port.
    SmsdUsb {
        /// Path or name of the port.
        path: String,
    },
    /// An SMSD whose USB port comes over TCP.
    SmsdUsbTcp {
        /// Name or address, an IPv6 address without brackets.
        host: String,
        /// TCP port.
        port: u16,
    },
    /// An SMSD with the standard firmware, over TCP.
    SmsdStandard {
        /// Name or address, an IPv6 address without brackets.
        host: String,
        /// TCP port.
        port: u16,
    },
    /// An SMD3 at a serial port.
    Smd3Serial {
        /// Path or name of the port.
        path: String,
    },
    /// An SMD3 whose lines come over TCP.
    Smd3Tcp {
        /// Name or address, an IPv6 address without brackets.
        host: String,
        /// TCP port.
        port: u16,
    },
}

impl Target {
    /// Reads a URI, `HOST:PORT` or the path of a serial port.
    ///
    /// # Errors
    /// [`Error::Usage`], which says what is wrong with the text and how one is written.
    pub fn parse(text: &str) -> Result<Target, Error> {
        let text = text.trim();
        let Some((scheme, rest)) = text.split_once("://") else { return bare(text) };
        match scheme.to_ascii_lowercase().as_str() {
            SMSD_TCP => smsd(rest),
            SMSD_USB => Ok(Target::SmsdUsb { path: path_of(rest, SMSD_USB)? }),
            SMSD_USB_TCP => {
                let (host, port) = host_and_port(rest, SMSD_USB_TCP, None)?;
                Ok(Target::SmsdUsbTcp { host, port })
            }
            SMSD_STANDARD => {
                let (host, port) = host_and_port(rest, SMSD_STANDARD, Some(STANDARD_PORT))?;
                Ok(Target::SmsdStandard { host, port })
            }
            SMD3_SERIAL => Ok(Target::Smd3Serial { path: path_of(rest, SMD3_SERIAL)? }),
            SMD3_TCP => {
                let (host, port) = host_and_port(rest, SMD3_TCP, None)?;
                Ok(Target::Smd3Tcp { host, port })
            }
            _ => Err(Error::Usage(format!(
                "`{}` is no kind of target; there are {SMSD_TCP}://, {SMSD_USB}://, {SMSD_USB_TCP}://, {SMSD_STANDARD}://, \
                 {SMD3_SERIAL}:// and {SMD3_TCP}://",
                shown(scheme)
            ))),
        }
    }

    /// The way to it.
    pub fn connect(&self) -> Box<dyn Connect> {
        match self {
            Target::Smsd { host, port, .. }
            | Target::SmsdUsbTcp { host, port }
            | Target::SmsdStandard { host, port }
            | Target::Smd3Tcp { host, port } => Box::new(Tcp::new(host, *port)),
            Target::SmsdUsb { path } | Target::Smd3Serial { path } => Box::new(Serial::new(path)),
        }
    }

    /// What errors call it, as in `192.168.1.2:502`.
    pub fn name(&self) -> String {
        self.connect().name().to_owned()
    }

    /// What it says of how to speak to an SMSD, the rest as it leaves the factory; `None` when it is none.
    pub fn smsd_options(&self) -> Option<SmsdOptions> {
        match self {
            Target::Smsd { unit, word_order, .. } => {
                Some(SmsdOptions { unit: *unit, word_order: *word_order, ..SmsdOptions::default() })
            }
            Target::SmsdUsb { .. } | Target::SmsdUsbTcp { .. } | Target::SmsdStandard { .. } => {
                Some(SmsdOptions::default())
            }
            Target::Smd3Serial { .. } | Target::Smd3Tcp { .. } => None,
        }
    }

    /// The driver of the SMSD that it is, over a way to it; `None` when it is none. Nothing is opened yet.
    pub fn smsd(&self, connect: impl Connect + 'static, options: SmsdOptions) -> Option<Box<dyn Smsd>> {
        Some(match self {
            Target::Smsd { .. } => Box::new(SmsdClient::new(connect, options)),
            Target::SmsdUsb { .. } | Target::SmsdUsbTcp { .. } => {
                Box::new(SmsdUsbClient::new(connect, Framing::Stuffed, options))
            }
            Target::SmsdStandard { .. } => Box::new(SmsdUsbClient::new(connect, Framing::Raw, options)),
            Target::Smd3Serial { .. } | Target::Smd3Tcp { .. } => return None,
        })
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Target::Smsd { host, port, unit, word_order } => {
                write!(f, "{SMSD_TCP}://{}:{port}?unit={unit}", bracketed(host))?;
                word_order.map_or(Ok(()), |order| write!(f, "&word_order={}", order.name()))
            }
            Target::SmsdUsb { path } => write!(f, "{SMSD_USB}://{}", encoded(path)),
            Target::SmsdUsbTcp { host, port } => write!(f, "{SMSD_USB_TCP}://{}:{port}", bracketed(host)),
            Target::SmsdStandard { host, port } => write!(f, "{SMSD_STANDARD}://{}:{port}", bracketed(host)),
            Target::Smd3Serial { path } => write!(f, "{SMD3_SERIAL}://{}", encoded(path)),
            Target::Smd3Tcp { host, port } => write!(f, "{SMD3_TCP}://{}:{port}", bracketed(host)),
        }
    }
}

/// A target without a scheme.
fn bare(text: &str) -> Result<Target, Error> {
    if text.starts_with('/') || is_com_port(text) {
        return Ok(Target::Smd3Serial { path: checked_path(text.to_owned(), SMD3_SERIAL)? });
    }
    let place = text.split_once('?').map_or(text, |(place, _)| place);
    match authority(place)? {
        (_, Some(_)) => smsd(text),
        (host, None) => Err(Error::Usage(format!(
            "`{}` is no target; write {SMSD_TCP}://HOST, HOST:PORT, {SMD3_TCP}://HOST:PORT or the path of a serial port",
            shown(&host)
        ))),
    }
}

fn smsd(rest: &str) -> Result<Target, Error> {
    let (place, query) = rest.split_once('?').unwrap_or((rest, ""));
    let (host, port) = authority(place)?;
    let (mut unit, mut word_order) = (DEFAULT_UNIT, None);
    for setting in query.split('&').filter(|setting| !setting.is_empty()) {
        match setting.split_once('=') {
            Some(("unit", value)) => unit = unit_of(value)?,
            Some(("word_order", value)) => word_order = Some(order_of(value)?),
            Some((key, _)) if key.eq_ignore_ascii_case("password") => return Err(no_password()),
            _ => {
                return Err(Error::Usage(format!(
                    "`{}` is no setting of an {SMSD_TCP}:// target; there are unit=1 and word_order=low-first",
                    shown(setting)
                )));
            }
        }
    }
    Ok(Target::Smsd { host, port: port.unwrap_or(MODBUS_PORT), unit, word_order })
}

/// Reads a host and its port, and nothing more; `usual` where the port may be left out.
fn host_and_port(rest: &str, scheme: &str, usual: Option<u16>) -> Result<(String, u16), Error> {
    let (place, query) = rest.split_once('?').unwrap_or((rest, ""));
    if query.to_ascii_lowercase().contains("password") {
        return Err(no_password());
    } else if !query.is_empty() {
        let setting = shown(query);
        return Err(Error::Usage(format!("`{setting}` is no setting of a {scheme}:// target; it has none")));
    }
    let (host, port) = authority(place)?;
    match port.or(usual) {
        Some(port) => Ok((host, port)),
        None => Err(Error::Usage(format!(
            "`{scheme}://{}` lacks a port; write {scheme}://HOST:PORT",
            shown(&host)
        ))),
    }
}

/// Reads the path of a serial port behind a scheme.
fn path_of(rest: &str, scheme: &str) -> Result<String, Error> {
    let path = decoded(rest).ok_or_else(|| {
        Error::Usage(format!(
            "`{}` is no path of a serial port; a % begins two hexadecimal digits, and is itself written %25",
            shown(rest)
        ))
    })?;
    checked_path(path, scheme)
}

fn checked_path(path: String, scheme: &str) -> Result<String, Error> {
    if path.is_empty() || path.contains(char::is_control) || path.trim() != path {
        return Err(Error::Usage(format!(
            "`{}` is no path of a serial port, as {scheme}:///dev/ttyACM0 names one",
            shown(&path)
        )));
    }
    Ok(path)
}

fn is_com_port(text: &str) -> bool {
    let digits = text.get(..3).filter(|com| com.eq_ignore_ascii_case("com")).and_then(|_| text.get(3..));
    digits.is_some_and(|digits| !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit()))
}

/// Reads a host and, behind a colon, a port.
fn authority(text: &str) -> Result<(String, Option<u16>), Error> {
    if text.contains('@') {
        return Err(no_password());
    }
    let text = text.strip_suffix('/').unwrap_or(text);
    let (host, port) = match text.strip_prefix('[').and_then(|rest| rest.split_once(']')) {
        Some((host, "")) => (host, None),
        Some((host, rest)) => (host, Some(rest.strip_prefix(':').unwrap_or(rest))),
        None => text.rsplit_once(':').map_or((text, None), |(host, port)| (host, Some(port))),
    };
    let bracketed = text.starts_with('[');
    if !is_host(host, bracketed) {
        return Err(Error::Usage(format!(
            "`{}` is no host; write a name, an IPv4 address, or an IPv6 address in brackets, as in [::1]:502",
            shown(text)
        )));
    }
    Ok((host.to_owned(), port.map(port_of).transpose()?))
}

/// Whether a name can be one of a host; who answers to it is not known here.
fn is_host(host: &str, bracketed: bool) -> bool {
    if bracketed {
        return host.parse::<std::net::Ipv6Addr>().is_ok();
    }
    let letter = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'.' | b'_');
    !host.is_empty() && host.len() <= 253 && host.bytes().all(letter)
}

fn port_of(text: &str) -> Result<u16, Error> {
    let digits = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let port = digits.then(|| text.parse().ok()).flatten().filter(|port| *port != 0);
    port.ok_or_else(|| Error::Usage(format!("`{}` is no TCP port; those are 1 to 65535", shown(text))))
}

fn unit_of(text: &str) -> Result<u8, Error> {
    text.parse().map_err(|_| {
        Error::Usage(format!("unit `{}` is out of range: 0 to 255; an SMSD's own is 1 to 247", shown(text)))
    })
}

fn order_of(text: &str) -> Result<WordOrder, Error> {
    WordOrder::from_name(text).ok_or_else(|| {
        let known = WordOrder::ALL.map(WordOrder::name).join(" or ");
        Error::Usage(format!("word_order `{}` is unknown; it is {known}", shown(text)))
    })
}

fn no_password() -> Error {
    Error::Usage(
        "a target holds no user and no password; give the password in an environment variable or a file"
            .to_owned(),
    )
}

fn bracketed(host: &str) -> String {
    if host.contains(':') { format!("[{host}]") } else { host.to_owned() }
}

/// A path as it stands in a URI.
fn encoded(path: &str) -> String {
    let escaped = |letter| match letter {
        '%' | '?' | '#' | ' ' => format!("%{:02X}", u32::from(letter)),
        _ => String::from(letter),
    };
    path.chars().map(escaped).collect()
}

/// A path as it stands behind a URI's scheme; `None` when it is not well formed.
fn decoded(text: &str) -> Option<String> {
    if text.contains(['?', '#']) {
        return None;
    }
    let (plain, rest) = text.split_once('%').unwrap_or((text, ""));
    let mut bytes = plain.as_bytes().to_vec();
    let escaped = if rest.is_empty() && plain.len() == text.len() { None } else { Some(rest) };
    for part in escaped.into_iter().flat_map(|rest| rest.split('%')) {
        let digits = part.get(..2).filter(|digits| digits.bytes().all(|byte| byte.is_ascii_hexdigit()))?;
        bytes.push(u8::from_str_radix(digits, 16).ok()?);
        bytes.extend_from_slice(part.as_bytes().get(2..)?);
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn smsd_at(host: &str, port: u16, unit: u8, word_order: Option<WordOrder>) -> Target {
        Target::Smsd { host: host.to_owned(), port, unit, word_order }
    }

    fn serial_at(path: &str) -> Target {
        Target::Smd3Serial { path: path.to_owned() }
    }

    #[test]
    fn every_form_of_a_target_is_read() {
        let tcp = Target::Smd3Tcp { host: "10.0.0.9".to_owned(), port: 4000 };
        for (text, target) in [
            (
                "smsd+tcp://stage:1502?unit=3&word_order=high-first",
                smsd_at("stage", 1502, 3, Some(WordOrder::HighFirst)),
            ),
            ("smsd+tcp://192.168.1.2", smsd_at("192.168.1.2", 502, 1, None)),
            ("SMSD+TCP://[::1]:5020/", smsd_at("::1", 5020, 1, None)),
            ("localhost:5020", smsd_at("localhost", 5020, 1, None)),
            ("localhost:5020?unit=9", smsd_at("localhost", 5020, 9, None)),
            ("[::1]:5020?word_order=low-first&unit=9", smsd_at("::1", 5020, 9, Some(WordOrder::LowFirst))),
            ("[fe80::1]:502", smsd_at("fe80::1", 502, 1, None)),
            ("smd3+serial:///dev/ttyACM0", serial_at("/dev/ttyACM0")),
            ("smd3+serial:///dev/a%20b%25", serial_at("/dev/a b%")),
            ("smd3+serial://COM3", serial_at("COM3")),
            ("/dev/serial/by-id/usb-AML_SMD3", serial_at("/dev/serial/by-id/usb-AML_SMD3")),
            ("com12", serial_at("com12")),
            ("smd3+tcp://10.0.0.9:4000", tcp),
            ("smsd+usb:///dev/ttyACM0", Target::SmsdUsb { path: "/dev/ttyACM0".to_owned() }),
            ("smsd+usb://COM4", Target::SmsdUsb { path: "COM4".to_owned() }),
            ("smsd+usb+tcp://[::1]:4001", Target::SmsdUsbTcp { host: "::1".to_owned(), port: 4001 }),
            ("smsd+std://10.0.0.9", Target::SmsdStandard { host: "10.0.0.9".to_owned(), port: 5000 }),
            ("smsd+std://stage:6000/", Target::SmsdStandard { host: "stage".to_owned(), port: 6000 }),
        ] {
            assert_eq!(Target::parse(text), Ok(target.clone()), "{text}");
            assert_eq!(Target::parse(&target.to_string()), Ok(target), "{text}");
        }
    }

    #[test]
    fn a_target_knows_its_name_and_how_an_smsd_is_spoken_to() {
        let target = Target::parse("smsd+tcp://[::1]:5020?unit=3&word_order=high-first").expect("a target");
        assert_eq!(target.name(), "[::1]:5020");
        let options = target.smsd_options().expect("an SMSD");
        assert_eq!((options.unit, options.word_order), (3, Some(WordOrder::HighFirst)));
        assert_eq!(options.password, SmsdOptions::default().password);
        let serial = Target::parse("/dev/ttyACM0").expect("a target");
        assert_eq!((serial.name().as_str(), serial.smsd_options()), ("/dev/ttyACM0", None));
        assert!(serial.smsd(serial.connect(), SmsdOptions::default()).is_none());
        for (text, name) in [("smsd+usb:///dev/ttyACM0", "/dev/ttyACM0"), ("smsd+std://stage", "stage:5000")]
        {
            let target = Target::parse(text).expect("a target");
            let options = target.smsd_options().expect("an SMSD");
            assert_eq!(target.name(), name);
            assert!(target.smsd(target.connect(), options).is_some());
        }
    }

    #[test]
    fn what_is_wrong_with_a_target_is_said() {
        for (text, words) in [
            ("stage", "`stage` is no target; write smsd+tcp://HOST"),
            (
                "ftp://stage",
                "`ftp` is no kind of target; there are smsd+tcp://, smsd+usb://, smsd+usb+tcp://, smsd+std://, \
                 smd3+serial:// and smd3+tcp://",
            ),
            ("smd3+tcp://uhv", "`smd3+tcp://uhv` lacks a port"),
            ("smsd+usb+tcp://stage", "`smsd+usb+tcp://stage` lacks a port"),
            ("smsd+usb://", "`` is no path of a serial port, as smsd+usb:///dev/ttyACM0"),
            ("smsd+std://stage?unit=1", "`unit=1` is no setting of a smsd+std:// target; it has none"),
            ("stage?unit=9", "`stage` is no target; write smsd+tcp://HOST"),
            ("stage:502?uint=1", "`uint=1` is no setting of an smsd+tcp:// target"),
            ("stage:502?unit=300", "unit `300` is out of range"),
            ("stage:0", "`0` is no TCP port"),
            ("stage:66000", "`66000` is no TCP port"),
            ("::1:502", "`::1:502` is no host"),
            ("smsd+tcp://stage?unit=300", "unit `300` is out of range"),
            ("smsd+tcp://stage?word_order=big", "word_order `big` is unknown; it is low-first or high-first"),
            ("smsd+tcp://stage?uint=1", "`uint=1` is no setting"),
            ("smsd+tcp://", "`` is no host"),
            ("smd3+serial://", "`` is no path of a serial port"),
            ("smd3+serial:///dev/x%2", "`/dev/x%2` is no path of a serial port"),
            ("smd3+serial:///dev/x?baud=9600", "`/dev/x?baud=9600` is no path of a serial port"),
        ] {
            let error = Target::parse(text).expect_err(text);
            assert!(error.to_string().starts_with(words), "{text}: {error}");
            assert_eq!(error.exit_code(), 1);
        }
    }

    #[test]
    fn a_password_in_a_target_is_refused_and_not_repeated() {
        for text in [
            "smsd+tcp://me:hunter2@stage",
            "smsd+tcp://stage?password=hunter2",
            "me:hunter2@stage:502",
            "stage:502?password=hunter2",
            "smsd+std://stage?password=hunter2",
            "smsd+usb+tcp://me:hunter2@stage:1",
        ] {
            let words = Target::parse(text).expect_err("refused").to_string();
            assert!(words.contains("environment variable") && !words.contains("hunter2"), "{words}");
        }
    }

    fn any_target() -> impl Strategy<Value = Target> {
        let order =
            prop_oneof![Just(None), Just(Some(WordOrder::LowFirst)), Just(Some(WordOrder::HighFirst))];
        let host = prop_oneof![
            "[a-z0-9][a-z0-9.-]{0,20}",
            any::<std::net::Ipv6Addr>().prop_map(|ip| ip.to_string())
        ];
        let smsd = (host.clone(), 1..=u16::MAX, any::<u8>(), order)
            .prop_map(|(host, port, unit, word_order)| Target::Smsd { host, port, unit, word_order });
        let tcp = (host, 1..=u16::MAX, 0..3).prop_map(|(host, port, kind)| match kind {
            0 => Target::Smd3Tcp { host, port },
            1 => Target::SmsdUsbTcp { host, port },
            _ => Target::SmsdStandard { host, port },
        });
        let serial = ("/[^\\p{C}\\s]{1,20}( x)?", any::<bool>()).prop_map(|(path, smd3)| {
            if smd3 { Target::Smd3Serial { path } } else { Target::SmsdUsb { path } }
        });
        prop_oneof![smsd, tcp, serial]
    }

    proptest! {
        #[test]
        fn what_is_displayed_is_read_as_the_same_target(target in any_target()) {
            prop_assert_eq!(Target::parse(&target.to_string()), Ok(target));
        }

        #[test]
        fn no_text_panics(text in "\\PC*") {
            let _ = Target::parse(&text);
        }

        #[test]
        fn what_is_read_displays_and_reads_again(text in "(smsd\\+(tcp|usb|usb\\+tcp|std)://|smd3\\+(serial|tcp)://)?[ -~é]{0,24}") {
            if let Ok(target) = Target::parse(&text) {
                prop_assert_eq!(Target::parse(&target.to_string()), Ok(target));
            }
        }
    }
}
