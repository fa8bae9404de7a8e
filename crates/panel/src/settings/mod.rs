//! Settings: shown from the tables, checked, applied and read back.

mod lan;
mod rows;

use crate::api::{Nothing, ThePanel, find, problem};
use crate::member::{Client, Member};
use crate::motion::to_the_end;
use axum::extract::State;
use lan::Parameter;
use rows::Row;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::sync::Arc;
use stepdrive_host::Error;
use stepdrive_host::settings::{Change, Key, Setting, changes, differences, objection, resolution};
use stepdrive_host::smsd::LanParameters;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_web::{Asked, Named, Problem, Reply};

#[derive(Debug, Serialize)]
pub(crate) struct Rows {
    rows: Vec<Row>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Put {
    set: BTreeMap<String, Value>,
}

#[derive(Debug, Default, Serialize)]
pub(crate) struct Applied {
    changed: Vec<Changed>,
    differs: Vec<Differs>,
}

#[derive(Debug, Serialize)]
struct Changed {
    name: &'static str,
    from: Value,
    to: Value,
    reads: Value,
}

#[derive(Debug, Serialize)]
struct Differs {
    name: &'static str,
    wanted: Value,
    reads: Value,
}

/// A controller's settings as they are now.
struct Found {
    model: Option<Model>,
    settings: Vec<Setting>,
    /// Of an SMSD, where they can be read.
    lan: Option<LanParameters>,
}

impl Found {
    async fn read(client: Client<'_>) -> Result<Found, Error> {
        let settings = client.read_settings().await?;
        let Client::Smsd(smsd) = client else { return Ok(Found { model: None, settings, lan: None }) };
        let lan = match smsd.lan_parameters().await {
            Ok(lan) => Some(lan),
            // What is written there makes no sense; that is no reason to show nothing else.
            Err(Error::Device(_)) => None,
            Err(error) => return Err(error),
        };
        Ok(Found { model: smsd.model().await?, settings, lan })
    }

    fn value(&self, key: Key) -> Option<f64> {
        value_in(&self.settings, key)
    }
}

fn value_in(settings: &[Setting], key: Key) -> Option<f64> {
    settings.iter().find(|(other, _)| *other == key).map(|(_, value)| *value)
}

/// A number for JSON: a whole one without a fraction.
fn number(value: f64) -> Value {
    // Within 2^53 nothing is lost by it.
    #[allow(clippy::cast_possible_truncation, reason = "whole, and within 53 bits")]
    if value.fract() == 0.0 && value.abs() < 9e15 { (value as i64).into() } else { value.into() }
}

pub(crate) async fn get(State(panel): ThePanel, Named(name): Named<String>) -> Result<Reply<Rows>, Problem> {
    let member = find(&panel, &name)?;
    let rows = member.work(async {
        let client = member.client();
        let found = Found::read(client).await?;
        let standing = client.standing().await?;
        let keys = Key::all(client.family()).into_iter();
        let stored = member.stored();
        let mut rows: Vec<Row> = keys.map(|key| Row::of(key, &found, stored.as_deref(), standing)).collect();
        rows.extend(
            found.lan.iter().flat_map(|lan| Parameter::ALL.into_iter().filter_map(|one| one.row(lan))),
        );
        Ok(rows)
    });
    Ok(Reply(Rows { rows: rows.await.map_err(problem)? }))
}

// ---- changing

/// What is wanted, as far as it could be understood.
#[derive(Default)]
struct Wanted {
    settings: Vec<Setting>,
    lan: Vec<(Parameter, String)>,
    /// What is wrong with a setting, by its name as it was given.
    mistakes: BTreeMap<String, String>,
}

impl Wanted {
    fn new(client: Client<'_>, set: &BTreeMap<String, Value>) -> Wanted {
        let all = Key::all(client.family());
        let mut wanted = Wanted::default();
        for (name, value) in set {
            let key = all.iter().find(|key| key.name().eq_ignore_ascii_case(name));
            let outcome = match (key, Parameter::named(name)) {
                (Some(key), _) => as_number(value).map(|number| wanted.settings.push((*key, number))),
                (None, Some(parameter)) if matches!(client, Client::Smsd(_)) => {
                    parameter.check(value).map(|text| wanted.lan.push((parameter, text)))
                }
                (None, _) => Err("there is no such setting".to_owned()),
            };
            if let Err(why) = outcome {
                wanted.mistakes.insert(name.clone(), why);
            }
        }
        wanted.settings.sort_by_key(|(key, _)| all.iter().position(|other| other == key));
        wanted
    }

    /// Checks everything against the controller as it is.
    fn check(&mut self, found: &Found) {
        let resolution = resolution(&self.settings, &found.settings);
        for (key, value) in &self.settings {
            if let Some(why) = key.refuses(*value, found.model, resolution) {
                self.mistakes.insert(key.name().to_owned(), why);
            }
        }
        if self.mistakes.is_empty()
            && let Some((key, why)) = objection(&self.settings, &found.settings)
        {
            self.mistakes.insert(key.name().to_owned(), why);
        }
    }

    /// Fails if anything is wrong.
    fn is_right(&self) -> Result<(), Problem> {
        let count = self.mistakes.len();
        let names = || {
            self.mistakes.keys().map(|name| name.escape_debug().to_string()).collect::<Vec<_>>().join(", ")
        };
        match count {
            0 => Ok(()),
            1 => Err(Problem::impossible(format!("{} cannot be set so; nothing was changed", names()))),
            _ => Err(Problem::impossible(format!(
                "{count} settings cannot be set so ({}); nothing was changed",
                names()
            ))),
        }
        .map_err(|problem| problem.with("fields", &self.mistakes))
    }
}

/// A number, or whether a switch is on.
fn as_number(value: &Value) -> Result<f64, String> {
    let number = match value {
        Value::Bool(on) => Some(f64::from(u8::from(*on))),
        Value::Number(number) => number.as_f64(),
        Value::String(text) => text.trim().parse().ok(),
        Value::Null | Value::Array(_) | Value::Object(_) => None,
    };
    number.filter(|number| number.is_finite()).ok_or_else(|| "takes a number".to_owned())
}

pub(crate) async fn put(
    State(panel): ThePanel,
    Named(name): Named<String>,
    Asked(Put { set }): Asked<Put>,
) -> Result<Reply<Applied>, Problem> {
    let member = find(&panel, &name)?;
    let mut wanted = Wanted::new(member.client(), &set);
    wanted.is_right()?;
    let found = member.work(Found::read(member.client())).await.map_err(problem)?;
    wanted.check(&found);
    wanted.is_right()?;
    to_the_end(async move {
        member.check_idle()?;
        let applied = member.work(apply(&member, &wanted, &found)).await;
        // Also what failed may have changed some.
        member.revise();
        applied.map(Reply)
    })
    .await
}

async fn apply(member: &Arc<Member>, wanted: &Wanted, found: &Found) -> Result<Applied, Error> {
    let client = member.client();
    let mut changes = changes(&wanted.settings, &found.settings);
    // What cannot be read may be anything.
    let untold = wanted.settings.iter().filter(|(key, _)| !client.tells(*key));
    changes.extend(untold.map(|(key, to)| Change { key: *key, now: None, to: *to }));
    client.check_state(member.name(), &changes).await?;
    client.apply(&changes, |_| {}).await?;
    if let (Client::Smsd(smsd), Some(now)) = (client, &found.lan) {
        lan::write(smsd, &wanted.lan, now).await?;
    }
    let after = Found::read(client).await.map_err(|cause| Error::Partly {
        done: format!("{} settings were sent, but could not be read back", changes.len() + wanted.lan.len()),
        cause: Box::new(cause),
    })?;
    Ok(told(wanted, &changes, found, &after))
}

/// What has become of it.
fn told(wanted: &Wanted, changes: &[Change], before: &Found, after: &Found) -> Applied {
    let json = |value: Option<f64>| value.map_or(Value::Null, number);
    let mut applied = Applied::default();
    applied.changed.extend(changes.iter().map(|change| Changed {
        name: change.key.name(),
        from: json(change.now),
        to: number(change.to),
        reads: json(after.value(change.key)),
    }));
    let differences = differences(&wanted.settings, &after.settings);
    applied.differs.extend(differences.iter().map(|one| Differs {
        name: one.key.name(),
        wanted: number(one.wanted),
        reads: number(one.found),
    }));
    let text = |lan: &Option<LanParameters>, one: Parameter| lan.as_ref().and_then(|lan| one.text(lan));
    for (parameter, to) in &wanted.lan {
        let (from, reads) = (text(&before.lan, *parameter), text(&after.lan, *parameter));
        if reads.as_ref() != Some(to) {
            applied.differs.push(Differs {
                name: parameter.name(),
                wanted: to.as_str().into(),
                reads: reads.clone().into(),
            });
        }
        if from.as_ref() != Some(to) {
            applied.changed.push(Changed {
                name: parameter.name(),
                from: from.into(),
                to: to.as_str().into(),
                reads: reads.into(),
            });
        }
    }
    applied
}

/// Has an SMD3 store its settings.
pub(crate) async fn store(
    State(panel): ThePanel,
    Named(name): Named<String>,
) -> Result<Reply<Nothing>, Problem> {
    let member = find(&panel, &name)?;
    to_the_end(async move {
        let client = member.smd3()?;
        member.note_stored(None);
        member.work(client.store()).await?;
        note_stored(&member).await;
        Ok(Reply(Nothing {}))
    })
    .await
}

/// An SMD3 has its settings now as it keeps them. Where they cannot be read nobody knows what it keeps.
async fn note_stored(member: &Member) {
    member.note_stored(member.work(member.client().read_settings()).await.ok());
    member.revise();
}

/// Has an SMD3 load what it has stored.
pub(crate) async fn load(
    State(panel): ThePanel,
    Named(name): Named<String>,
) -> Result<Reply<Nothing>, Problem> {
    let member = find(&panel, &name)?;
    to_the_end(async move {
        let client = member.smd3()?;
        member.check_idle()?;
        member.note_stored(None);
        member.work(client.load()).await?;
        note_stored(&member).await;
        Ok(Reply(Nothing {}))
    })
    .await
}

/// Puts the LAN parameters of an SMSD into effect. It closes its connections, and may be elsewhere afterwards.
pub(crate) async fn apply_lan(
    State(panel): ThePanel,
    Named(name): Named<String>,
) -> Result<Reply<Nothing>, Problem> {
    let member = find(&panel, &name)?;
    to_the_end(async move {
        member.work(member.smsd()?.trigger(Reg::ApplyNetworkConfiguration)).await?;
        member.revise();
        Ok(Reply(Nothing {}))
    })
    .await
}
