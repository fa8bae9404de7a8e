//! What is wrong on the line between a drive and its client: the settings.
//!
//! They are part of a drive's state, are switched at run time and recorded as text. What they do to requests and
//! replies is done outside the drive, where the bytes are: in the server's links.

use crate::duration;
use crate::names::shown;
use alloc::format;
use alloc::string::{String, ToString};
use core::fmt;
use core::time::Duration;
use stepdrive_spec::modbus::Exception;

/// The longest pause that can be set. A reply that is to come later than that may as well not come.
pub const MOST_PAUSE: Duration = Duration::from_hours(1);

/// The fewest pieces that a reply can be cut into.
pub const FEWEST_PIECES: u8 = 2;

/// The most pieces that a reply can be cut into.
pub const MOST_PIECES: u8 = 64;

/// The pause between the pieces of a reply when none is given: so long that a client's system does not put them together
/// again, so short that no client gives up.
const PIECES_GAP: Duration = Duration::from_millis(5);

/// A family of controllers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// The SMSD-LAN controllers, on Modbus TCP.
    Smsd,
    /// The SMD3, on lines of text.
    Smd3,
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Family::Smsd => "SMSD",
            Family::Smd3 => "SMD3",
        })
    }
}

/// What is wrong on the line of a drive; by default nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LineFaults {
    /// Whether anything gets through.
    pub connection: Connection,
    /// Replies come late.
    pub delay: Option<Delay>,
    /// A request is carried out, but its reply does not come.
    pub drop: Chance,
    /// Replies come in pieces.
    pub pieces: Option<Pieces>,
    /// Some bytes of a reply come twice.
    pub duplicate: Chance,
    /// One to three bits of a reply are wrong.
    pub damage: Chance,
    /// A Modbus reply has another transaction identifier than its request.
    pub wrong_id: Chance,
    /// A Modbus request is answered with this exception and not carried out. Only 04,
    /// [`Exception::ServerDeviceFailure`], and 06, [`Exception::ServerDeviceBusy`], can be set.
    pub exception: Option<(Exception, Chance)>,
}

/// Whether anything gets through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Connection {
    /// It does.
    #[default]
    Good,
    /// Connections are closed, and new ones too.
    Cut,
    /// Connections stay and new ones are taken, but no request reaches the drive and none is answered.
    Silent,
}

/// How late replies come: `delay` ± `jitter`, uniformly, and never before their time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Delay {
    /// The mean, up to [`MOST_PAUSE`].
    pub delay: Duration,
    /// How far from it, up to [`MOST_PAUSE`].
    pub jitter: Duration,
}

/// How replies are cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pieces {
    /// Into how many, [`FEWEST_PIECES`] to [`MOST_PIECES`]; a reply of fewer bytes comes byte by byte.
    pub count: u8,
    /// The pause before each but the first, up to [`MOST_PAUSE`].
    pub gap: Duration,
}

/// How often something happens, in parts per million.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Chance(u32);

impl Chance {
    /// It does not happen.
    pub const NEVER: Chance = Chance(0);
    /// It happens each time.
    pub const ALWAYS: Chance = Chance(Chance::WHOLE);
    /// A million parts.
    const WHOLE: u32 = 1_000_000;
    /// Parts in a percent, and decimals that they make.
    const PERCENT: u32 = Chance::WHOLE / 100;
    const DECIMALS: usize = 4;

    /// So many times in a hundred; above 100 it is [`Chance::ALWAYS`].
    pub const fn percent(percent: u32) -> Chance {
        Chance::per_million(percent.saturating_mul(Chance::PERCENT))
    }

    /// So many times in a million; above a million it is [`Chance::ALWAYS`].
    pub const fn per_million(parts: u32) -> Chance {
        if parts < Chance::WHOLE { Chance(parts) } else { Chance::ALWAYS }
    }

    /// Times in a million, 0 to 1 000 000.
    pub const fn parts_per_million(self) -> u32 {
        self.0
    }

    /// Reads `30%`, `0.5%`, with up to four decimals, `always` or `never`.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(text: &str) -> Result<Chance, ChanceError> {
        match text {
            "always" => return Ok(Chance::ALWAYS),
            "never" => return Ok(Chance::NEVER),
            _ => {}
        }
        let number = text.strip_suffix('%').ok_or(ChanceError::Malformed)?;
        let (whole, decimals) = number.split_once('.').unwrap_or((number, "0"));
        let digits = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
        if !digits(whole) || !digits(decimals) {
            return Err(ChanceError::Malformed);
        }
        if decimals.len() > Chance::DECIMALS {
            return Err(ChanceError::TooFine);
        }
        let percent: u32 = whole.parse().map_err(|_| ChanceError::TooMuch)?;
        let parts: u32 = format!("{decimals:0<width$}", width = Chance::DECIMALS).parse().unwrap_or(0);
        let parts = percent.saturating_mul(Chance::PERCENT).saturating_add(parts);
        if parts > Chance::WHOLE { Err(ChanceError::TooMuch) } else { Ok(Chance(parts)) }
    }
}

impl fmt::Display for Chance {
    /// `always`, `never` or a percentage as in `0.5%`; [`Chance::parse`] reads it back.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (*self, self.0 / Chance::PERCENT, self.0 % Chance::PERCENT) {
            (Chance::ALWAYS, ..) => f.pad("always"),
            (Chance::NEVER, ..) => f.pad("never"),
            (_, whole, 0) => f.pad(&format!("{whole}%")),
            (_, whole, parts) => {
                let decimals = format!("{parts:0width$}", width = Chance::DECIMALS);
                f.pad(&format!("{whole}.{}%", decimals.trim_end_matches('0')))
            }
        }
    }
}

/// Why a text is no [`Chance`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChanceError {
    /// It is no percentage.
    Malformed,
    /// It is above 100 %.
    TooMuch,
    /// It has more than four decimals.
    TooFine,
}

impl fmt::Display for ChanceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            ChanceError::Malformed => "a chance is a percentage, as in 30% or 0.5%",
            ChanceError::TooMuch => "a chance is at most 100%",
            ChanceError::TooFine => "a chance has at most four decimals, as in 0.0001%",
        })
    }
}

impl core::error::Error for ChanceError {}

/// A fault that can be set on a line.
#[derive(Clone, Copy, Debug)]
pub struct LineFault {
    /// Its name, as in `reply-delay`.
    pub name: &'static str,
    /// Its settings besides `off`. `TIME`, `JITTER` and `GAP` are as in 20ms, `CHANCE` is as in 30%; what is in brackets
    /// may be left out.
    pub settings: &'static str,
    /// The family whose lines can have it; `None` for both.
    pub family: Option<Family>,
    /// What it is, in one line.
    pub about: &'static str,
    set: fn(&mut LineFaults, &[&str]) -> Result<(), String>,
    off: fn(&mut LineFaults),
    get: fn(&LineFaults) -> Option<String>,
}

/// The setting of faults that happen with a chance.
const OFTEN: &str = "on | CHANCE";

/// All faults of a line.
pub const LINE_FAULTS: &[LineFault] = &[
    LineFault {
        name: "connection",
        settings: "cut | silent",
        family: None,
        about: "cut: connections are closed; silent: they stay, but nothing is carried out or answered",
        set: set_connection,
        off: |faults| faults.connection = Connection::Good,
        get: |faults| match faults.connection {
            Connection::Good => None,
            Connection::Cut => Some("cut".to_string()),
            Connection::Silent => Some("silent".to_string()),
        },
    },
    LineFault {
        name: "reply-delay",
        settings: "TIME [JITTER]",
        family: None,
        about: "replies come late, by TIME ± JITTER",
        set: set_delay,
        off: |faults| faults.delay = None,
        get: |faults| faults.delay.map(delay_text),
    },
    LineFault {
        name: "reply-drop",
        settings: OFTEN,
        family: None,
        about: "requests are carried out, but their replies do not come",
        set: |faults, words| set_chance(&mut faults.drop, words),
        off: |faults| faults.drop = Chance::NEVER,
        get: |faults| often(faults.drop),
    },
    LineFault {
        name: "reply-pieces",
        settings: "2..64 [GAP]",
        family: None,
        about: "replies come in so many pieces with GAP between them",
        set: set_pieces,
        off: |faults| faults.pieces = None,
        get: |faults| {
            faults.pieces.map(|pieces| format!("{} {}", pieces.count, duration::display(pieces.gap)))
        },
    },
    LineFault {
        name: "reply-duplicate",
        settings: OFTEN,
        family: None,
        about: "some bytes of a reply come twice",
        set: |faults, words| set_chance(&mut faults.duplicate, words),
        off: |faults| faults.duplicate = Chance::NEVER,
        get: |faults| often(faults.duplicate),
    },
    LineFault {
        name: "reply-damage",
        settings: OFTEN,
        family: None,
        about: "one to three bits of a reply are wrong",
        set: |faults, words| set_chance(&mut faults.damage, words),
        off: |faults| faults.damage = Chance::NEVER,
        get: |faults| often(faults.damage),
    },
    LineFault {
        name: "reply-id",
        settings: OFTEN,
        family: Some(Family::Smsd),
        about: "replies have a wrong transaction identifier; packets, a wrong identification",
        set: |faults, words| set_chance(&mut faults.wrong_id, words),
        off: |faults| faults.wrong_id = Chance::NEVER,
        get: |faults| often(faults.wrong_id),
    },
    LineFault {
        name: "exception",
        settings: "04 [CHANCE] | 06 [CHANCE]",
        family: Some(Family::Smsd),
        about: "requests are answered with this Modbus exception and not carried out",
        set: set_exception,
        off: |faults| faults.exception = None,
        get: |faults| faults.exception.map(|(exception, chance)| exception_text(exception, chance)),
    },
];

impl LineFault {
    /// Whether a line of this family can have it.
    pub fn is_for(&self, family: Family) -> bool {
        self.family.is_none_or(|only| only == family)
    }

    /// The fault with this name.
    pub fn named(name: &str) -> Option<&'static LineFault> {
        LINE_FAULTS.iter().find(|fault| fault.name == name)
    }

    /// The faults that a line of this family can have.
    pub fn of(family: Family) -> impl Iterator<Item = &'static LineFault> {
        LINE_FAULTS.iter().filter(move |fault| fault.is_for(family))
    }
}

impl LineFaults {
    /// Sets the fault `name` of a line of this family; see [`LINE_FAULTS`]. `off` ends it.
    ///
    /// # Errors
    /// There is no such fault for this family, or it cannot be set to that; nothing has changed then.
    pub fn set(&mut self, name: &str, setting: &str, family: Family) -> Result<(), LineFaultError> {
        let fault =
            LineFault::named(name).ok_or_else(|| LineFaultError::Unknown { name: shown(name), family })?;
        if !fault.is_for(family) {
            return Err(LineFaultError::NotForFamily { name: fault.name, family });
        }
        let mut words = [""; MOST_WORDS + 1];
        let mut count = 0;
        for (place, word) in words.iter_mut().zip(setting.split_whitespace()) {
            *place = word;
            count += 1;
        }
        let words = words.get(..count).unwrap_or(&[]);
        if words == ["off"] {
            (fault.off)(self);
            return Ok(());
        }
        (fault.set)(self, words).map_err(|reason| LineFaultError::Setting {
            name: fault.name,
            setting: shown(setting),
            settings: fault.settings,
            reason,
        })
    }

    /// Whether the line is in order.
    pub fn is_good(&self) -> bool {
        *self == LineFaults::default()
    }

    /// What is wrong: names and settings that [`LineFaults::set`] takes back, in the order of [`LINE_FAULTS`].
    pub fn describe(&self) -> impl Iterator<Item = (&'static str, String)> {
        LINE_FAULTS.iter().filter_map(|fault| Some((fault.name, (fault.get)(self)?)))
    }
}

/// The most words that a setting has.
const MOST_WORDS: usize = 2;

fn set_connection(faults: &mut LineFaults, words: &[&str]) -> Result<(), String> {
    faults.connection = match words {
        ["cut"] => Connection::Cut,
        ["silent"] => Connection::Silent,
        words => return Err(unexpected(words)),
    };
    Ok(())
}

fn set_delay(faults: &mut LineFaults, words: &[&str]) -> Result<(), String> {
    let (delay, jitter) = match words {
        [delay] => (pause(delay)?, Duration::ZERO),
        [delay, jitter] => (pause(delay)?, pause(jitter)?),
        words => return Err(unexpected(words)),
    };
    let any = !(delay.is_zero() && jitter.is_zero());
    faults.delay = any.then_some(Delay { delay, jitter });
    Ok(())
}

fn set_pieces(faults: &mut LineFaults, words: &[&str]) -> Result<(), String> {
    let (count, gap) = match words {
        [count] => (*count, PIECES_GAP),
        [count, gap] => (*count, pause(gap)?),
        words => return Err(unexpected(words)),
    };
    let count = count.parse().ok().filter(|count| (FEWEST_PIECES..=MOST_PIECES).contains(count));
    let count = count.ok_or_else(|| format!("the number of pieces is {FEWEST_PIECES} to {MOST_PIECES}"))?;
    faults.pieces = Some(Pieces { count, gap });
    Ok(())
}

fn set_exception(faults: &mut LineFaults, words: &[&str]) -> Result<(), String> {
    let (code, chance) = match words {
        [code] => (*code, Chance::ALWAYS),
        [code, often] => (*code, chance(often)?),
        words => return Err(unexpected(words)),
    };
    let exception = match code {
        "04" | "4" => Exception::ServerDeviceFailure,
        "06" | "6" => Exception::ServerDeviceBusy,
        _ => return Err("the exception is 04 (device failure) or 06 (device busy)".to_string()),
    };
    faults.exception = (chance != Chance::NEVER).then_some((exception, chance));
    Ok(())
}

fn set_chance(field: &mut Chance, words: &[&str]) -> Result<(), String> {
    *field = match words {
        ["on"] => Chance::ALWAYS,
        [often] => chance(often)?,
        words => return Err(unexpected(words)),
    };
    Ok(())
}

fn chance(word: &str) -> Result<Chance, String> {
    Chance::parse(word).map_err(|error| error.to_string())
}

fn pause(word: &str) -> Result<Duration, String> {
    let pause = duration::parse(word).map_err(|error| error.to_string())?;
    if pause > MOST_PAUSE {
        return Err(format!(
            "a pause is at most {}; for no replies at all, set connection to silent",
            duration::display(MOST_PAUSE)
        ));
    }
    Ok(pause)
}

/// What is wrong with words of which there are too few or too many, or with the one that is there.
fn unexpected(words: &[&str]) -> String {
    match words {
        [] => "the setting is missing".to_string(),
        [_] => "there is no such setting".to_string(),
        _ => "there is too much".to_string(),
    }
}

/// The setting of a fault that happens with a chance; none when it does not.
fn often(chance: Chance) -> Option<String> {
    match chance {
        Chance::NEVER => None,
        Chance::ALWAYS => Some("on".to_string()),
        chance => Some(chance.to_string()),
    }
}

fn delay_text(delay: Delay) -> String {
    let Delay { delay, jitter } = delay;
    if jitter.is_zero() {
        return duration::display(delay).to_string();
    }
    format!("{} {}", duration::display(delay), duration::display(jitter))
}

fn exception_text(exception: Exception, chance: Chance) -> String {
    match chance {
        Chance::ALWAYS => format!("{:02}", exception.code()),
        chance => format!("{:02} {chance}", exception.code()),
    }
}

/// Why a fault cannot be set.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LineFaultError {
    /// There is no fault of this name.
    Unknown {
        /// The name, shortened if it is long.
        name: String,
        /// The family of the drive on the line.
        family: Family,
    },
    /// Lines of this family cannot have this fault.
    NotForFamily {
        /// The fault.
        name: &'static str,
        /// The family of the drive on the line.
        family: Family,
    },
    /// It cannot be set to that.
    Setting {
        /// The fault.
        name: &'static str,
        /// What it was to be set to, shortened if it is long.
        setting: String,
        /// What it can be set to.
        settings: &'static str,
        /// What is wrong.
        reason: String,
    },
}

impl fmt::Display for LineFaultError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LineFaultError::Unknown { name, family } => {
                write!(f, "unknown line fault `{name}`; {}", Choice(*family))
            }
            LineFaultError::NotForFamily { name, family } => {
                write!(f, "{name} is not for the line of an {family}; {}", Choice(*family))
            }
            LineFaultError::Setting { name, setting, settings, reason } => {
                write!(f, "{name} cannot be `{setting}`: {reason}; its settings are {settings} | off")
            }
        }
    }
}

impl core::error::Error for LineFaultError {}

/// The names of the faults that a line of a family can have.
struct Choice(Family);

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "an {} has", self.0)?;
        for (index, fault) in LineFault::of(self.0).enumerate() {
            write!(f, "{} {}", if index == 0 { "" } else { "," }, fault.name)?;
        }
        Ok(())
    }
}
