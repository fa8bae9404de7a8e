//! What can be recorded of an axis, by name.

use crate::Failure;
use crate::axis::map::{self, Slot};
use crate::axis::names::shown;
use crate::axis::{Client, Opened, instead};
use crate::table::Column;
use stepdrive_host::Error;
use stepdrive_host::smd3::Smd3Client;
use stepdrive_host::smsd::Smsd;
use stepdrive_spec::smd3::commands::{Access as CommandAccess, COMMANDS, Command, Kind};
use stepdrive_spec::smsd::registers::Reg;

/// The names of what every axis has.
const OWN: [&str; 2] = ["position", "speed"];

/// Something that can be read of an axis again and again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    /// Its position in its unit.
    Position,
    /// Its speed in its unit a second.
    Speed,
    /// A register of an SMSD.
    Register(Slot),
    /// A command of an SMD3.
    Command(Command),
}

impl Quantity {
    /// The quantity of a name.
    ///
    /// # Errors
    /// The axis has none of that name; the text says what there is instead.
    fn named(opened: &Opened, name: &str) -> Result<Quantity, String> {
        match (name, opened.client()) {
            ("position", _) => Ok(Quantity::Position),
            ("speed", _) => Ok(Quantity::Speed),
            (name, Client::Smsd(client)) => register(client, name),
            (name, Client::Smd3(_)) => command(name),
        }
    }

    /// Its column.
    fn column(self, opened: &Opened) -> Column {
        let unit = opened.axis().scale().unit();
        let (name, unit) = match self {
            Quantity::Position => ("position".to_owned(), unit.to_string()),
            Quantity::Speed => ("speed".to_owned(), format!("{unit}/s")),
            Quantity::Register(slot) => (slot.to_string(), map::plural(slot.row().unit)),
            Quantity::Command(command) => (command.to_string(), map::plural(command.info().unit)),
        };
        Column { name: format!("{}.{name}", opened.name()), unit }
    }
}

fn register(client: &dyn Smsd, name: &str) -> Result<Quantity, String> {
    let slot = map::find(name)?;
    client.check_readable(slot.reg).map_err(|why| why.to_string())?;
    Ok(Quantity::Register(slot))
}

fn command(name: &str) -> Result<Quantity, String> {
    let known = || {
        let all: Vec<&str> =
            COMMANDS.iter().filter(|row| is_number(row.command)).map(|row| row.mnemonic).collect();
        instead(name, &all)
    };
    let command = Command::from_mnemonic(&name.to_ascii_uppercase());
    let command = command.ok_or_else(|| format!("there is no command `{}`; {}", shown(name), known()))?;
    if is_number(command) {
        Ok(Quantity::Command(command))
    } else {
        Err(format!("{command} does not read as a number"))
    }
}

fn is_number(command: Command) -> bool {
    let info = command.info();
    let readable = matches!(info.access, CommandAccess::Read | CommandAccess::ReadWrite);
    readable && !matches!(info.kind, Kind::None | Kind::Text)
}

/// What is recorded of an axis.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    quantities: Vec<Quantity>,
}

/// What is recorded of each axis: of every name what the axes have that know it, and by default position and speed.
pub(super) fn choose(axes: &[Opened], names: &[String]) -> Result<Vec<Choice>, Failure> {
    let mut choices: Vec<Choice> = axes.iter().map(|_| Choice { quantities: Vec::new() }).collect();
    let usual = OWN.map(str::to_owned);
    for name in if names.is_empty() { usual.as_slice() } else { names } {
        let mut nobody_knows = None;
        let mut known = false;
        for (opened, choice) in axes.iter().zip(&mut choices) {
            match meant(opened, axes, name).map(|name| Quantity::named(opened, name)) {
                Some(Ok(quantity)) => {
                    known = true;
                    if !choice.quantities.contains(&quantity) {
                        choice.quantities.push(quantity);
                    }
                }
                Some(Err(why)) => nobody_knows = Some(format!("{}: {why}", opened.name())),
                None => {}
            }
        }
        if let Some(why) = nobody_knows.filter(|_| !known) {
            return Err(Failure::Usage(format!("{why}; every axis has position and speed")));
        }
    }
    Ok(choices)
}

/// What a name means of an axis: the name itself, what stands behind the name of this axis, or nothing where it begins with
/// the name of another.
fn meant<'a>(opened: &Opened, axes: &[Opened], name: &'a str) -> Option<&'a str> {
    let behind = |opened: &Opened| name.strip_prefix(opened.name())?.strip_prefix('.');
    let names_one = axes.iter().any(|axis| behind(axis).is_some());
    if names_one { behind(opened) } else { Some(name) }
}

impl Choice {
    /// A column for each quantity.
    pub(super) fn columns(&self, opened: &Opened) -> Vec<Column> {
        self.quantities.iter().map(|quantity| quantity.column(opened)).collect()
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.quantities.len()
    }

    /// Reads them all, in their order.
    pub(super) async fn read(&self, opened: &Opened) -> Result<Vec<Option<f64>>, Error> {
        let own = |quantity: &Quantity| matches!(quantity, Quantity::Position | Quantity::Speed);
        let state = if self.quantities.iter().any(own) { Some(opened.axis().state().await?) } else { None };
        let controllers = match opened.client() {
            Client::Smsd(client) => self.read_registers(client).await?,
            Client::Smd3(client) => self.read_commands(client).await?,
        };
        let mut controllers = controllers.into_iter();
        let value = |quantity: &Quantity| match quantity {
            Quantity::Position => state.as_ref().map(|state| state.position.value.as_f64()),
            Quantity::Speed => state.as_ref().map(|state| state.speed),
            Quantity::Register(_) | Quantity::Command(_) => controllers.next(),
        };
        Ok(self.quantities.iter().map(value).collect())
    }

    /// Reads the registers among them, as many as can be in one request.
    async fn read_registers(&self, client: &dyn Smsd) -> Result<Vec<f64>, Error> {
        let slots: Vec<Slot> = self.quantities.iter().filter_map(|quantity| quantity.slot()).collect();
        let firsts: Vec<Reg> = slots.iter().filter(|slot| slot.index == 0).map(|slot| slot.reg).collect();
        let mut read = client.read_many(&firsts).await?.into_iter();
        let mut values = Vec::new();
        for slot in slots {
            let value = match slot.index {
                0 => read.next().unwrap_or_default(),
                index => client.read_at(slot.reg, index).await?,
            };
            values.push(value as f64);
        }
        Ok(values)
    }

    async fn read_commands(&self, client: &Smd3Client) -> Result<Vec<f64>, Error> {
        let mut values = Vec::new();
        for quantity in &self.quantities {
            if let Quantity::Command(command) = quantity {
                values.push(client.get_number(*command).await?);
            }
        }
        Ok(values)
    }
}

impl Quantity {
    const fn slot(self) -> Option<Slot> {
        if let Quantity::Register(slot) = self { Some(slot) } else { None }
    }
}
