//! `stepdrive record`.

mod file;
mod quantity;
mod source;

use super::progress::Progress;
use super::trust::Keep;
use super::{Reach, block_on, find_all, some_time};
use crate::Failure;
use crate::table::{Column, Format, Row};
use crate::terminal::{print_json, tell};
use crate::up::end_requested;
use chrono::{DateTime, SecondsFormat, TimeDelta, Utc};
use file::{Sink, check_free};
use futures_util::future::join_all;
use serde_json::{Value, json};
use source::Source;
use std::path::PathBuf;
use std::time::Duration;
use tokio::task::LocalSet;
use tokio::time::{Instant, Interval, MissedTickBehavior, interval_at};

/// What to record, and where to.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive record -a stage -o run.csv                              position and speed, ten times a second, until Ctrl-C
  stepdrive record -a stage position SPEED Inputs --rate 50Hz --for 10s -o run.parquet
  stepdrive record -a stage -a uhv position TMOT -o both.csv        TMOT of the axis that knows it
  stepdrive record -a stage -a uhv stage.ABS_POS uhv.PACT -o counters.csv

The first columns are `time [s]`, since the recording began, and `utc`. A cell is empty while an axis does not answer; that is
told on stderr, and the recording goes on. CSV is in the file after a second at most, Parquet when the recording ends.")]
pub(crate) struct RecordArgs {
    /// What to record: position, speed, a register of an SMSD, a command of an SMD3; of every axis that knows the name, or of
    /// one, as in stage.position. Position and speed by default.
    #[arg(value_name = "NAME")]
    names: Vec<String>,
    /// An axis: its name in stepdrive.toml, or where its controller is. May be said several times; all of stepdrive.toml by
    /// default.
    #[arg(short, long = "axis", value_name = "NAME|URI")]
    axes: Vec<String>,
    /// The file: .csv or .parquet.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Rows a second: 0.01Hz to 1000Hz.
    #[arg(long, value_name = "RATE", default_value = "10Hz", value_parser = parse_rate)]
    rate: f64,
    /// How long; until Ctrl-C otherwise.
    #[arg(long = "for", value_name = "DURATION", value_parser = some_time)]
    lasts: Option<Duration>,
    /// Replace a file that is there.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    reach: Reach,
}

/// How long an axis may hold up a row.
const PATIENCE: Duration = Duration::from_millis(300);

fn parse_rate(text: &str) -> Result<f64, String> {
    let number = text.trim().trim_end_matches("Hz").trim_end();
    let rate = number.parse::<f64>().ok().filter(|rate| (0.01..=1000.0).contains(rate));
    rate.ok_or_else(|| "a rate is 0.01Hz to 1000Hz, as in 10Hz".to_owned())
}

/// Records until the time is over or the end is asked for.
pub(crate) fn record(args: &RecordArgs) -> Result<(), Failure> {
    Format::of(&args.output)?;
    check_free(&args.output, args.force)?;
    let mut axes = Vec::new();
    for found in find_all(&args.axes, &args.reach)? {
        axes.push(found.open(&args.reach)?);
    }
    let choices = quantity::choose(&axes, &args.names)?;
    let sources = axes.into_iter().zip(choices).map(|(opened, choice)| Source::new(opened, choice));
    let sources: Vec<Source> = sources.filter(|source| !source.columns().is_empty()).collect();
    let done = block_on(LocalSet::new().run_until(run(args, sources)))??;
    if args.reach.json {
        return print_json(&done.json(args));
    }
    done.tell(args);
    Ok(())
}

/// What was recorded.
struct Done {
    started: DateTime<Utc>,
    columns: Vec<Column>,
    rows: u64,
    /// How many rows there should have been.
    due: u64,
    lasted: Duration,
    /// Rows without anything of an axis, by axis.
    missing: Vec<(String, u64)>,
}

async fn run(args: &RecordArgs, mut sources: Vec<Source>) -> Result<Done, Failure> {
    let end = end_requested().map_err(|error| Failure::Failed(format!("cannot catch signals: {error}")))?;
    for tried in join_all(sources.iter().map(Source::try_out)).await {
        tried?;
    }
    let columns: Vec<Column> = sources.iter().flat_map(Source::columns).collect();
    let period = Duration::from_secs_f64(1.0 / args.rate);
    let mut recording = Recording {
        sink: Sink::create(&args.output, args.force, &columns, period)?,
        began: Instant::now(),
        started: Utc::now(),
        rows: 0,
        progress: args.lasts.map(|lasts| (Progress::new("recording"), lasts)),
    };
    let written = tokio::select! {
        written = recording.rows_until(args.lasts, period, &mut sources) => written,
        () = end => Ok(()),
    };
    let lasted = args.lasts.unwrap_or(Duration::MAX).min(recording.began.elapsed());
    let (rows, started) = (recording.rows, recording.started);
    written.and(recording.sink.finish())?;
    for source in &sources {
        source.opened.record.keep(source.opened.axis().trust(), Keep::Doubts);
    }
    let missing = sources.iter().map(|source| (source.opened.name().to_owned(), source.missing)).collect();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it is above 0, and small")]
    let due = (lasted.as_secs_f64() * args.rate).floor() as u64;
    Ok(Done { started, columns, rows, due, lasted, missing })
}

/// A recording that goes on.
struct Recording {
    sink: Sink,
    /// When it began, on the clock that nobody sets.
    began: Instant,
    /// The same as a date.
    started: DateTime<Utc>,
    rows: u64,
    /// Where it is known how long it will last.
    progress: Option<(Progress, Duration)>,
}

impl Recording {
    /// Writes a row at every tick that begins before the time is over.
    async fn rows_until(
        &mut self,
        lasts: Option<Duration>,
        period: Duration,
        sources: &mut [Source],
    ) -> Result<(), Failure> {
        let mut ticks = ticks(self.began, period);
        loop {
            let at = ticks.tick().await.duration_since(self.began);
            if lasts.is_some_and(|lasts| at >= lasts) {
                return Ok(());
            }
            self.row(sources).await?;
            if let Some((progress, lasts)) = &mut self.progress {
                let thousandths = |time: Duration| usize::try_from(time.as_millis()).unwrap_or(usize::MAX);
                progress.show(thousandths(at), thousandths(*lasts));
            }
        }
    }

    /// Reads all axes at once and writes what they say. The time of a row is half-way between question and answer.
    async fn row(&mut self, sources: &mut [Source]) -> Result<(), Failure> {
        let asked = Instant::now();
        sources.iter_mut().for_each(Source::ask);
        let answers = join_all(sources.iter_mut().map(|source| source.answer(asked + PATIENCE))).await;
        let time = asked.duration_since(self.began) + asked.elapsed() / 2;
        let utc = self.started + TimeDelta::from_std(time).unwrap_or(TimeDelta::MAX);
        self.sink.write(&Row { seconds: time.as_secs_f64(), utc, values: answers.concat() })?;
        self.rows += 1;
        Ok(())
    }
}

/// Ticks that never pile up: what was missed is left out.
fn ticks(began: Instant, period: Duration) -> Interval {
    let mut ticks = interval_at(began, period);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    ticks
}

impl Done {
    fn tell(&self, args: &RecordArgs) {
        let seconds = self.lasted.as_secs_f64();
        let mut parts = vec![format!("{}: {} rows in {seconds:.1} s", args.output.display(), self.rows)];
        if self.late() > 0 {
            let rate = self.rows as f64 / seconds.max(f64::EPSILON);
            parts.push(format!("{} left out, since no more than {rate:.1} Hz could be read", self.late()));
        }
        let missing = self.missing.iter().filter(|(_, rows)| *rows > 0);
        parts.extend(missing.map(|(axis, rows)| format!("{rows} without {axis}")));
        tell(&parts.join("; "));
    }

    /// How many rows were left out because those before took too long.
    fn late(&self) -> u64 {
        self.due.saturating_sub(self.rows)
    }

    fn json(&self, args: &RecordArgs) -> Value {
        let gaps = self.missing.iter().filter(|(_, rows)| *rows > 0);
        let gaps: Vec<Value> = gaps.map(|(axis, rows)| json!({ "axis": axis, "rows": rows })).collect();
        let columns: Vec<String> = self.columns.iter().map(Column::to_string).collect();
        json!({
            "file": args.output,
            "format": Format::of(&args.output).map(Format::name).unwrap_or_default(),
            "started": self.started.to_rfc3339_opts(SecondsFormat::Millis, true),
            "duration_s": self.lasted.as_secs_f64(),
            "rate_hz": args.rate,
            "columns": columns,
            "rows": self.rows,
            "rows_left_out": self.late(),
            "gaps": gaps,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_is_rows_a_second() {
        assert_eq!(parse_rate("10Hz"), Ok(10.0));
        assert_eq!(parse_rate("0.5 Hz"), Ok(0.5));
        assert_eq!(parse_rate("1000"), Ok(1000.0));
        for text in ["0", "-1Hz", "1001Hz", "fast", "", "nan", "inf"] {
            assert!(parse_rate(text).is_err(), "{text}");
        }
    }
}
