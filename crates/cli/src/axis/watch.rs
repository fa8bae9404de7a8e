//! `stepdrive watch`.

use super::attend::Interrupts;
use super::status::{faults, motion, state_json, trust};
use super::trust::Keep;
use super::{Opened, Reach, block_on, find_all, some_time};
use crate::Failure;
use crate::rig::table::{Align, Column, table};
use crate::rig::watch::{BOLD, HiddenCursor, RED, Screen, cut, write_now};
use crate::terminal::{self, cannot_write};
use serde_json::{Map, Value};
use std::io::{self, IsTerminal};
use std::rc::Rc;
use std::time::Duration;
use stepdrive_host::Error;
use stepdrive_host::axis::AxisState;
use stepdrive_host::trust::Trust;
use tokio::sync::mpsc;
use tokio::task::LocalSet;
use tokio::time::Instant;

/// What is watched.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive watch                          all axes of stepdrive.toml, in a table that is redrawn
  stepdrive watch stage uhv --every 1s
  stepdrive watch 192.168.1.2:502 > watched.txt    a line for each change
  stepdrive watch stage --json             a line of JSON for each look

  $ stepdrive watch
  AXIS   POSITION  TRUST    MOTION             FAULTS
  stage    12.5mm  trusted  stands, energised  none
  uhv    3 turns   trusted  stands, energised  none

Ctrl-C ends it. It only looks: nothing moves or stops by it.")]
pub(crate) struct WatchArgs {
    /// The axes, each a name or a URI as `--axis` of the other commands takes; all of stepdrive.toml by default.
    #[arg(value_name = "NAME|URI")]
    names: Vec<String>,
    /// The same, as the other commands take it.
    #[arg(short, long, value_name = "NAME|URI")]
    axis: Vec<String>,
    /// How often to look.
    #[arg(long, value_name = "DURATION", default_value = "200ms", value_parser = some_time)]
    every: Duration,
    #[command(flatten)]
    reach: Reach,
}

/// What was seen of an axis.
struct Seen {
    /// Which axis.
    number: usize,
    outcome: Result<AxisState, Error>,
}

/// Shows axes until the person has seen enough.
pub(crate) fn watch(args: &WatchArgs) -> Result<(), Failure> {
    let names: Vec<String> = args.names.iter().chain(&args.axis).cloned().collect();
    let found = find_all(&names, &args.reach)?;
    let opened = found.into_iter().map(|found| found.open(&args.reach).map(Rc::new));
    let opened = opened.collect::<Result<Vec<Rc<Opened>>, Failure>>()?;
    block_on(LocalSet::new().run_until(follow(&opened, args)))??;
    for axis in &opened {
        axis.record.keep(axis.axis().trust(), Keep::Doubts);
    }
    Ok(())
}

/// Looks at all axes at once, and shows what is seen.
async fn follow(opened: &[Rc<Opened>], args: &WatchArgs) -> Result<(), Failure> {
    let mut interrupts = Interrupts::catch()?;
    let (tell, mut told) = mpsc::channel(opened.len().max(1));
    for (number, axis) in opened.iter().enumerate() {
        tokio::task::spawn_local(look(number, Rc::clone(axis), args.every, tell.clone()));
    }
    let mut view = View::new(args.reach.json, opened).map_err(|error| cannot_write(&error))?;
    loop {
        let seen = tokio::select! {
            () = interrupts.next() => return Ok(()),
            Some(seen) = told.recv() => seen,
        };
        match view.show(&seen) {
            Ok(()) => {}
            // Whoever read it has seen enough, as in `| head`.
            Err(Stopped::Output(error)) if error.kind() == io::ErrorKind::BrokenPipe => return Ok(()),
            Err(Stopped::Output(error)) => return Err(cannot_write(&error)),
            Err(Stopped::Axis(error)) => return Err(error.into()),
        }
    }
}

/// Looks at an axis again and again, for as long as somebody listens.
async fn look(number: usize, axis: Rc<Opened>, every: Duration, tell: mpsc::Sender<Seen>) {
    loop {
        let next = Instant::now() + every;
        if let Some(trust) = axis.record.news() {
            axis.axis().believe(trust);
        }
        let outcome = axis.axis().state().await;
        if tell.send(Seen { number, outcome }).await.is_err() {
            return;
        }
        tokio::time::sleep_until(next).await;
    }
}

/// Why no more is shown.
enum Stopped {
    Output(io::Error),
    /// An axis could not be looked at even once.
    Axis(Error),
}

impl From<io::Error> for Stopped {
    fn from(error: io::Error) -> Stopped {
        Stopped::Output(error)
    }
}

/// What is shown, and how.
struct View<'a> {
    opened: &'a [Rc<Opened>],
    began: Instant,
    rows: Vec<Option<Row>>,
    how: How,
}

/// How it is shown.
enum How {
    /// A line of JSON for each look.
    Json,
    /// A line for each change.
    Lines,
    /// A table that is redrawn.
    Live(Screen, HiddenCursor),
}

/// An axis in the table.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Row {
    cells: [String; COLUMNS],
    wrong: bool,
}

const COLUMNS: usize = 5;

const HEADINGS: [Column; COLUMNS] = [
    ("AXIS", Align::Left),
    ("POSITION", Align::Right),
    ("TRUST", Align::Left),
    ("MOTION", Align::Left),
    ("FAULTS", Align::Left),
];

impl View<'_> {
    fn new(json: bool, opened: &[Rc<Opened>]) -> io::Result<View<'_>> {
        let how = match json {
            true => How::Json,
            false if io::stdout().is_terminal() => How::Live(Screen::new(), HiddenCursor::hide()?),
            false => How::Lines,
        };
        Ok(View { opened, began: Instant::now(), rows: opened.iter().map(|_| None).collect(), how })
    }

    fn show(&mut self, seen: &Seen) -> Result<(), Stopped> {
        let Some((axis, row)) = self.opened.get(seen.number).zip(self.rows.get_mut(seen.number)) else {
            return Ok(());
        };
        let new = match &seen.outcome {
            Ok(state) => shown(axis, state),
            // What cannot be reached at all is a mistake; what is lost later may come back.
            Err(error) if row.is_none() => return Err(Stopped::Axis(error.clone())),
            Err(error) => lost(axis, error),
        };
        let changed = row.as_ref() != Some(&new);
        let cells = new.cells.join("  ");
        *row = Some(new);
        let seconds = self.began.elapsed().as_secs_f64();
        let text = match &mut self.how {
            How::Json => format!("{}\n", Value::from(as_json(axis, &seen.outcome, seconds))),
            How::Lines if changed => format!("{seconds:10.3}  {cells}\n"),
            How::Lines => return Ok(()),
            How::Live(screen, _) => draw(screen, &self.rows),
        };
        Ok(write_now(&text)?)
    }
}

fn shown(axis: &Opened, state: &AxisState) -> Row {
    let cells = [
        axis.name().to_owned(),
        state.position.to_string(),
        trust(state),
        motion(axis.axis(), state),
        faults(state),
    ];
    Row { cells, wrong: !state.faults.is_empty() || state.trust != Trust::Trusted }
}

fn lost(axis: &Opened, error: &Error) -> Row {
    let [position, trust, faults] = ["?", "?", "?"].map(str::to_owned);
    Row { cells: [axis.name().to_owned(), position, trust, error.to_string(), faults], wrong: true }
}

fn as_json(axis: &Opened, outcome: &Result<AxisState, Error>, seconds: f64) -> Map<String, Value> {
    let mut object = match outcome {
        Ok(state) => state_json(axis, state),
        Err(error) => Map::from_iter([
            ("axis".to_owned(), axis.name().into()),
            ("error".to_owned(), error.to_string().into()),
        ]),
    };
    object.insert("time_s".to_owned(), seconds.into());
    object
}

/// Draws the table where it was drawn last.
fn draw(screen: &mut Screen, rows: &[Option<Row>]) -> String {
    let size = terminal::size();
    let columns = size.map(|size| size.columns);
    let known: Vec<&Row> = rows.iter().flatten().collect();
    let cells: Vec<[String; COLUMNS]> = known.iter().map(|row| row.cells.clone()).collect();
    let lines = table(HEADINGS, &cells);
    let painted = lines.iter().enumerate().map(|(number, line)| match number.checked_sub(1) {
        None => screen.painted(BOLD, line, columns),
        Some(row) if known.get(row).is_some_and(|row| row.wrong) => screen.painted(RED, line, columns),
        Some(_) => cut(line, columns),
    });
    let painted = painted.collect();
    screen.redraw(painted, size)
}
