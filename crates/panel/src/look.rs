//! Looking at an axis: what is seen of it at a glance, and what when somebody looks closely.

use crate::Kept;
use crate::flags::{self, Named};
use crate::member::{Aim, Client, Member};
use crate::notices::Level;
use serde::Serialize;
use std::sync::Arc;
use stepdrive_host::Error;
use stepdrive_host::axis::AxisState;
use stepdrive_host::smd3::Smd3Client;
use stepdrive_host::smsd::{ProgramState, Smsd};
use stepdrive_host::trust::{Doubt, Trust};
use stepdrive_spec::smd3::commands::Command;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::registers::Reg;
use tokio::time::Instant;

/// Of so many looks one also reads what changes seldom.
const SELDOM: u32 = 10;

/// What of an SMD3 is worth plotting beside its motion: its temperature, what bake keeps, its mode.
const SMD3_QUANTITIES: [Command; 3] = [Command::Tmot, Command::Baket, Command::Mode];

/// Bits of a state.
pub(crate) mod bit {
    pub(crate) const LOST: u16 = 1;
    pub(crate) const MOVING: u16 = 2;
    pub(crate) const ENERGISED: u16 = 4;
    pub(crate) const LIMIT_NEGATIVE: u16 = 8;
    pub(crate) const LIMIT_POSITIVE: u16 = 16;
    pub(crate) const TRUSTED: u16 = 32;
    pub(crate) const WITHIN: u16 = 64;
    pub(crate) const FAULT: u16 = 128;
    pub(crate) const JOGGING: u16 = 256;
    pub(crate) const HOMING: u16 = 512;
    pub(crate) const PROGRAM: u16 = 1024;
    pub(crate) const UNREAD: u16 = 2048;
}

/// What is seen at a glance.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Reading {
    /// In the axis' unit.
    pub(crate) position: f64,
    /// In its unit a second.
    pub(crate) speed: f64,
    /// See [`bit`].
    pub(crate) bits: u16,
    /// Latched faults.
    pub(crate) faults: Vec<&'static str>,
}

/// What is seen when somebody looks closely.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Focus {
    /// Milliseconds since the panel began.
    pub(crate) t: u64,
    /// Empty where it stands with the rest of what is known of the axis.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub(crate) name: String,
    pub(crate) p: f64,
    pub(crate) v: f64,
    /// Full steps as the controller counts them.
    pub(crate) steps: f64,
    pub(crate) b: u16,
    pub(crate) e: Vec<&'static str>,
    pub(crate) doubt: Option<String>,
    /// Where the motion that was started from here goes.
    pub(crate) target: Option<f64>,
    pub(crate) flags: Named<bool>,
    pub(crate) q: Named<f64>,
    pub(crate) inputs: Named<bool>,
    pub(crate) outputs: Named<bool>,
    pub(crate) program: Option<ProgramRow>,
    /// Age of the last reading, when it is lost.
    /// Grows when somebody has changed its settings from here.
    pub(crate) rev: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) a: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) w: Option<String>,
}

/// The user program as it stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct ProgramRow {
    running: Option<bool>,
    mem: u16,
    line: u16,
}

impl Focus {
    /// Whether something else than the time differs.
    pub(crate) fn differs(&self, other: &Focus) -> bool {
        Focus { t: 0, a: None, ..self.clone() } != Focus { t: 0, a: None, ..other.clone() }
    }
}

/// Somebody who looks at an axis again and again.
pub(crate) struct Looker {
    member: Arc<Member>,
    looks: u32,
    program: Option<ProgramState>,
    relay: bool,
    quantities: Vec<(&'static str, f64)>,
}

impl Looker {
    pub(crate) fn new(member: Arc<Member>) -> Looker {
        Looker { member, looks: 0, program: None, relay: false, quantities: Vec::new() }
    }

    /// Looks, closely or not.
    pub(crate) async fn look(&mut self, closely: bool) -> Result<(Reading, Option<Focus>), Error> {
        let member = Arc::clone(&self.member);
        let seldom = self.looks.is_multiple_of(SELDOM);
        self.looks = self.looks.wrapping_add(1);
        if seldom {
            member.hear_news();
        }
        let began = Instant::now();
        let state = member.axis().state().await?;
        member.keep_trust(Kept::Looked);
        arrived(&member, &state, began);
        if let Client::Smsd(client) = member.client()
            && (seldom || closely)
        {
            self.program = Some(client.program().await?);
        }
        let reading = self.reading(&state);
        if !closely {
            return Ok((reading, None));
        }
        let mut focus = focus(&member, &state, &reading);
        match member.client() {
            Client::Smsd(client) => self.smsd(client, seldom, &mut focus).await?,
            Client::Smd3(client) => self.smd3(client, seldom, &mut focus).await?,
        }
        Ok((reading, Some(focus)))
    }

    fn reading(&self, state: &AxisState) -> Reading {
        let (jogging, homing) = {
            let doing = self.member.doing();
            (doing.jog.is_some(), doing.homing)
        };
        let bits = [
            (bit::MOVING, state.moving),
            (bit::ENERGISED, state.energised),
            (bit::LIMIT_NEGATIVE, state.limit_negative),
            (bit::LIMIT_POSITIVE, state.limit_positive),
            (bit::TRUSTED, state.trust == Trust::Trusted),
            (bit::WITHIN, state.within_soft_limits),
            (bit::FAULT, !state.faults.is_empty()),
            (bit::JOGGING, jogging),
            (bit::HOMING, homing),
            (bit::PROGRAM, self.program.and_then(|program| program.running) == Some(true)),
        ];
        Reading {
            position: state.position.value.as_f64(),
            speed: rounded(state.speed),
            bits: bits.into_iter().filter(|(_, set)| *set).fold(0, |bits, (bit, _)| bits | bit),
            faults: state.faults.iter().map(|fault| fault.name).collect(),
        }
    }

    async fn smsd(&mut self, client: &dyn Smsd, seldom: bool, focus: &mut Focus) -> Result<(), Error> {
        let snapshot = client.snapshot().await?;
        let tells_relay = client.check_readable(Reg::Relay).is_ok();
        if seldom && tells_relay {
            self.relay = client.relay().await?;
        }
        focus.flags = flags::of_smsd(snapshot.status);
        focus.inputs =
            Named(Input::ALL.into_iter().map(|input| (input.name(), snapshot.input(input))).collect());
        focus.outputs = Named(tells_relay.then_some(("relay", self.relay)).into_iter().collect());
        focus.q = Named(vec![
            (Reg::AbsPos.info().name, snapshot.position.into()),
            (Reg::Speed.info().name, snapshot.speed.into()),
            (Reg::ElPos.info().name, snapshot.el_pos.into()),
        ]);
        focus.program = self.program.map(|program| ProgramRow {
            running: program.running,
            mem: program.area,
            line: program.line,
        });
        Ok(())
    }

    async fn smd3(&mut self, client: &Smd3Client, seldom: bool, focus: &mut Focus) -> Result<(), Error> {
        if seldom {
            self.quantities.clear();
            for command in SMD3_QUANTITIES {
                self.quantities.push((command.info().mnemonic, client.get_number(command).await?));
            }
        }
        focus.flags = flags::of_smd3(client.last_flags().unwrap_or_default());
        focus.q = Named(self.quantities.clone());
        Ok(())
    }
}

fn focus(member: &Member, state: &AxisState, reading: &Reading) -> Focus {
    Focus {
        name: member.name().to_owned(),
        p: reading.position,
        v: reading.speed,
        steps: rounded(state.full_steps),
        b: reading.bits,
        e: reading.faults.clone(),
        doubt: state.doubt.map(|doubt| doubt.to_string()),
        target: member.doing().aim.map(|aim| aim.to),
        rev: member.revision(),
        ..Focus::default()
    }
}

/// Sees whether a move that was started from here has ended, and whether where it should.
fn arrived(member: &Member, state: &AxisState, began: Instant) {
    let Some(aim) = member.doing().aim.filter(|aim| !state.moving && began > aim.since) else { return };
    member.doing().aim = None;
    if aim.stops != member.stops() || off(aim, state) <= aim.within {
        return;
    }
    let ahead = aim.to - state.position.value.as_f64();
    if (ahead > 0.0 && state.limit_positive) || (ahead < 0.0 && state.limit_negative) {
        member.axis().distrust(Doubt::LimitMet);
    }
    let (name, position, unit) = (member.name(), state.position, state.position.unit);
    let faults: Vec<&str> = state.faults.iter().map(|fault| fault.name).collect();
    let why = if faults.is_empty() {
        "somebody or something stopped it on the way".to_owned()
    } else {
        faults.join(", ")
    };
    member.tell(Level::Error, format!("{name} stands at {position} instead of {} {unit}: {why}", aim.to));
}

fn off(aim: Aim, state: &AxisState) -> f64 {
    (aim.to - state.position.value.as_f64()).abs()
}

/// A number to the millionth.
fn rounded(value: f64) -> f64 {
    let rounded = (value * 1e6).round() / 1e6;
    // A zero has no sign for people.
    if rounded == 0.0 { 0.0 } else { rounded }
}
