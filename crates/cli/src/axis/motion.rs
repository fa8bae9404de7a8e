//! `stepdrive move`, `run`, `stop`, `home`, `zero`.

use super::attend::{attend, show_move, stopped};
use super::status::{plain, position, state_json, unit_key};
use super::trust::Keep;
use super::{AxisArgs, Opened, act_on, look_at, some_time};
use crate::Failure;
use crate::terminal::{print, print_json};
use serde_json::{Map, Value, json};
use std::time::Duration;
use stepdrive_host::axis::{MoveOptions, Plan, Stop};
use stepdrive_host::trust::Doubt;
use stepdrive_host::units::{Amount, Decimal, Goal, Speed};
use stepdrive_host::{Direction, Error};

/// A move.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive move -a stage to 12.5mm
  stepdrive move -a stage by -3 turns --speed 5mm/s
  stepdrive move -a stage by \"200 steps\" --no-wait
  stepdrive move -a stage to 12.5mm --dry-run

  $ stepdrive move -a stage to 12.5mm
  stage is at 12.5mm (500 full steps), trusted

Units are mm, deg, turns and steps, as they fit the axis; a step is a full step. Nothing goes beyond the soft limits of
stepdrive.toml. A position that is not trusted is no place to go `to`: `home` or `zero` the axis first.
Ctrl-C stops the motor softly, a second Ctrl-C at once.")]
pub(crate) struct MoveArgs {
    #[command(flatten)]
    axis: AxisArgs,
    /// `to` a position or `by` a distance.
    #[arg(value_name = "to|by")]
    how: String,
    /// The position or the distance, as in 12.5mm or -3.
    #[arg(value_name = "AMOUNT", allow_hyphen_values = true)]
    amount: Option<String>,
    /// Its unit, where it stands by itself.
    unit: Option<String>,
    /// Speed of the move; it is set in the controller and stays. By default the one set there.
    #[arg(long, value_name = "SPEED", value_parser = Speed::parse)]
    speed: Option<Speed>,
    /// Return as soon as it has begun.
    #[arg(long, conflicts_with = "dry_run")]
    no_wait: bool,
    /// How long to wait at most; it goes on then.
    #[arg(long, value_name = "DURATION", value_parser = some_time)]
    timeout: Option<Duration>,
    /// Show travel, time and what would be sent, and send nothing that changes anything.
    #[arg(long)]
    dry_run: bool,
    /// Go to a position though it is not trusted.
    #[arg(long)]
    untrusted: bool,
}

/// An endless motion.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive run -a stage +
  stepdrive run -a stage - 2mm/s
  stepdrive run -a pump + 1 turns/s

  $ stepdrive run -a stage +
  stage runs in direction +, to the soft limit 200mm

It returns as soon as the motor turns; `stepdrive stop` ends it, and where there are soft limits, the one that lies there.")]
pub(crate) struct RunArgs {
    #[command(flatten)]
    axis: AxisArgs,
    /// Towards higher (+) or lower (-) positions.
    #[arg(value_name = "+|-", value_parser = direction, allow_hyphen_values = true)]
    direction: Direction,
    /// Its speed, as in 2mm/s; it is set in the controller and stays. By default the one set there.
    #[arg(value_name = "SPEED", num_args = 0..=2)]
    speed: Vec<String>,
    /// Go to a soft limit though the position is not trusted.
    #[arg(long)]
    untrusted: bool,
}

/// The end of a motion.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive stop -a stage
  stepdrive stop -a stage --hard
  stepdrive stop -a stage --free

  $ stepdrive stop -a stage
  stage is at 3.2mm (128 full steps), trusted

A user program that runs in an SMSD ends too, or it would move the motor again. An SMD3 that is stopped with --hard or --free
is disabled until `stepdrive clear`, as nothing else stops or frees it so.")]
pub(crate) struct StopArgs {
    #[command(flatten)]
    axis: AxisArgs,
    /// At once, without braking; steps may be lost.
    #[arg(long, conflicts_with = "free")]
    hard: bool,
    /// Brake, and then de-energise the motor.
    #[arg(long)]
    free: bool,
}

/// Looking for home.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive home -a stage
  stepdrive home -a stage + --speed 2mm/s --timeout 1min

  $ stepdrive home -a stage -
  stage is at 0mm (0 full steps), trusted

An SMSD looks for the signal at its input SET_ZERO, an SMD3 for the limit switch of that direction, which has to be in use
(`set L 1` and `set L- 1`). Ctrl-C stops the motor softly, a second Ctrl-C at once.")]
pub(crate) struct HomeArgs {
    #[command(flatten)]
    axis: AxisArgs,
    /// Where to look.
    #[arg(value_name = "+|-", value_parser = direction, default_value = "-", allow_hyphen_values = true)]
    direction: Direction,
    /// Speed of the search; by default the one set in the controller, or 16 full steps/s over USB, where an SMSD does not tell it.
    #[arg(long, value_name = "SPEED", value_parser = Speed::parse)]
    speed: Option<Speed>,
    /// How long to look at most; the motor is stopped then.
    #[arg(long, value_name = "DURATION", value_parser = some_time)]
    timeout: Option<Duration>,
}

/// Setting zero.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive zero -a stage

  $ stepdrive zero -a stage
  stage is at 0mm (0 full steps), trusted")]
pub(crate) struct ZeroArgs {
    #[command(flatten)]
    axis: AxisArgs,
}

fn direction(text: &str) -> Result<Direction, String> {
    match text {
        "+" => Ok(Direction::Positive),
        "-" => Ok(Direction::Negative),
        _ => Err("a direction is + or -".to_owned()),
    }
}

impl MoveArgs {
    fn goal(&self) -> Result<Goal, Error> {
        let words = [Some(&self.how), self.amount.as_ref(), self.unit.as_ref()];
        Goal::parse(&words.into_iter().flatten().map(String::as_str).collect::<Vec<&str>>().join(" "))
    }

    fn options(&self) -> MoveOptions {
        MoveOptions {
            speed: self.speed,
            no_wait: self.no_wait,
            override_trust: self.untrusted,
            timeout: self.timeout,
        }
    }
}

/// Moves an axis.
pub(crate) fn r#move(args: &MoveArgs) -> Result<(), Failure> {
    let (goal, options, json) = (args.goal()?, args.options(), args.axis.reach.json);
    if args.dry_run {
        return look_at(&args.axis, async |opened| {
            let plan = opened.axis().plan(goal, options).await.map_err(with_option)?;
            if json { print_json(&dry_run_json(opened, &plan)) } else { print(&dry_run(opened, &plan)) }
        });
    }
    act_on(&args.axis, async |opened| {
        let axis = opened.axis();
        let plan = axis.plan(goal, options).await.map_err(with_option)?;
        opened.note_departure();
        let shown = show_move(axis, plan.from, plan.to);
        let done = attend(opened, axis.go(goal, options), shown).await?.map_err(with_option)?;
        if !options.no_wait {
            return arrived(opened, Some(&done), json).await;
        }
        if json {
            print_json(&Value::from(plan_json(opened, &done)))
        } else {
            print(&departed(opened, &done))
        }
    })
}

/// A refusal that can be overridden, with the option that does it.
fn with_option(error: Error) -> Error {
    let Error::Refused(text) = error else { return error };
    Error::Refused(text.replace("or override this;", "or override this with --untrusted;"))
}

/// Says where an axis has come to stand.
async fn arrived(opened: &Opened, plan: Option<&Plan>, json: bool) -> Result<(), Failure> {
    let state = opened.axis().state().await?;
    if !json {
        return print(&format!("{} is at {}\n", opened.name(), position(&state)));
    }
    let mut object = plan.map(|plan| plan_json(opened, plan)).unwrap_or_default();
    object.extend(state_json(opened, &state));
    print_json(&Value::from(object))
}

fn departed(opened: &Opened, plan: &Plan) -> String {
    let Plan { from, to, distance, .. } = plan;
    format!("{} goes from {from} to {to}: {distance}, {}\n", opened.name(), about(plan.duration))
}

fn about(duration: Duration) -> String {
    format!("about {} s", plain((duration.as_secs_f64() * 100.0).round() / 100.0))
}

fn dry_run(opened: &Opened, plan: &Plan) -> String {
    let Plan { goal, from, to, distance, full_steps, trust, .. } = plan;
    let name = opened.name();
    let rounded = if plan.rounded {
        format!("\n{goal} is between two positions that the controller counts; {to} is the nearest")
    } else {
        String::new()
    };
    let supposed = plan.supposed.as_ref().map_or_else(String::new, |supposed| format!("\n{supposed}"));
    let steps = plain(*full_steps);
    let lines = plan.sent.join("\n  ");
    format!(
        "{name} would go from {from} to {to}: {distance} ({steps} full steps), {}{supposed}{rounded}\n\
         the position is {trust}\nthis would be sent:\n  {lines}\n",
        about(plan.duration)
    )
}

fn dry_run_json(opened: &Opened, plan: &Plan) -> Value {
    let mut object = plan_json(opened, plan);
    object.insert("dry_run".to_owned(), true.into());
    object.insert("sent".to_owned(), json!(plan.sent));
    if let Some(supposed) = &plan.supposed {
        object.insert("supposed".to_owned(), supposed.as_str().into());
    }
    object.into()
}

/// A move, with the units in the names.
fn plan_json(opened: &Opened, plan: &Plan) -> Map<String, Value> {
    let unit = unit_key(opened.axis().scale().unit());
    let entries = [
        ("axis".to_owned(), opened.name().into()),
        (format!("from_{unit}"), plan.from.value.as_f64().into()),
        (format!("to_{unit}"), plan.to.value.as_f64().into()),
        (format!("distance_{unit}"), plan.distance.value.as_f64().into()),
        ("distance_full_steps".to_owned(), plan.full_steps.into()),
        ("rounded".to_owned(), plan.rounded.into()),
        ("expected_s".to_owned(), plan.duration.as_secs_f64().into()),
        ("trust".to_owned(), plan.trust.name().into()),
    ];
    entries.into_iter().collect()
}

/// Lets an axis run.
pub(crate) fn run(args: &RunArgs) -> Result<(), Failure> {
    let words = args.speed.join(" ");
    let speed = if words.is_empty() { None } else { Some(Speed::parse(&words)?) };
    let options = MoveOptions { speed, override_trust: args.untrusted, ..MoveOptions::default() };
    let direction = args.direction;
    act_on(&args.axis, async |opened| {
        let axis = opened.axis();
        axis.state().await?;
        opened.note_departure();
        attend(opened, axis.run(direction, options), async {}).await?.map_err(with_option)?;
        let range = axis.soft_limits().range();
        let limit = range.map(|(low, high)| if direction == Direction::Positive { high } else { low });
        let unit = axis.scale().unit();
        if args.axis.reach.json {
            let limit = limit.map(Decimal::as_f64);
            let key = format!("soft_limit_{}", unit_key(unit));
            return print_json(
                &json!({ "axis": opened.name(), "direction": direction.to_string(), key: limit }),
            );
        }
        let until = match limit {
            Some(limit) => format!("to the soft limit {}", Amount::new(limit, unit)),
            None => "until it is stopped".to_owned(),
        };
        print(&format!("{} runs in direction {direction}, {until}\n", opened.name()))
    })
}

/// Stops an axis.
pub(crate) fn stop(args: &StopArgs) -> Result<(), Failure> {
    let how = match (args.hard, args.free) {
        (true, _) => Stop::Hard,
        (false, true) => Stop::Free,
        (false, false) => Stop::Soft,
    };
    act_on(&args.axis, async |opened| {
        stopped(opened.axis(), how).await?;
        arrived(opened, None, args.axis.reach.json).await
    })
}

/// Looks for home.
pub(crate) fn home(args: &HomeArgs) -> Result<(), Failure> {
    let options = MoveOptions { speed: args.speed, timeout: args.timeout, ..MoveOptions::default() };
    act_on(&args.axis, async |opened| {
        let axis = opened.axis();
        axis.state().await?;
        opened.note_departure();
        let homed = attend(opened, axis.home(args.direction, options), async {}).await;
        if homed.is_err() {
            // Broken off, it may have set zero or not.
            axis.distrust(Doubt::HomingFailed);
        }
        homed??;
        opened.record.keep(axis.trust(), Keep::Zero);
        arrived(opened, None, args.axis.reach.json).await
    })
}

/// Takes the place where an axis stands as zero.
pub(crate) fn zero(args: &ZeroArgs) -> Result<(), Failure> {
    act_on(&args.axis, async |opened| {
        opened.axis().zero().await?;
        opened.record.keep(opened.axis().trust(), Keep::Zero);
        arrived(opened, None, args.axis.reach.json).await
    })
}
