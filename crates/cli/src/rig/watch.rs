//! `stepdrive rig watch`.

use super::client::{Client, part};
use super::show::{self, Picture};
use super::sse::{Event, Events};
use super::state::RigState;
use crate::Failure;
use crate::terminal::{self, Size, cannot_write, no_color};
use crate::up::end_requested;
use std::fmt::Write as _;
use std::io::{self, IsTerminal, Read, Write};
use std::thread;
use tokio::runtime;
use tokio::sync::mpsc;

/// How to watch.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive rig watch                     a table that is redrawn, at a terminal
  stepdrive rig watch > watched.txt       a line for each change
  stepdrive rig watch --json --every 1s   the whole state, a line of JSON at each change")]
pub(super) struct WatchArgs {
    /// How often to look at most, in real time: 20ms to 60s.
    #[arg(long, value_name = "DURATION", default_value = "200ms")]
    every: String,
}

/// Shows what the drives do until the person has seen enough, or the rig ends.
pub(super) fn watch(client: &Client, args: &WatchArgs, json: bool) -> Result<(), Failure> {
    let events = client.listen(&format!("/v1/events?every={}", part(&args.every)))?;
    let runtime =
        runtime::Builder::new_current_thread().enable_all().build().map_err(|error| cannot_begin(&error))?;
    let ended = runtime.block_on(async {
        let end = end_requested().map_err(|error| cannot_begin(&error))?;
        let told = spawn_reader(events).map_err(|error| cannot_begin(&error))?;
        let mut view = View::new(json).map_err(|error| cannot_write(&error))?;
        follow(told, end, &mut view).await.or_else(|error| failed(client, &error))
    });
    match ended? {
        Ended::Enough => Ok(()),
        Ended::Gone => Err(Failure::Failed(format!("the rig at {} has ended", client.base()))),
    }
}

fn cannot_begin(error: &io::Error) -> Failure {
    Failure::Failed(format!("cannot start to watch: {error}"))
}

fn failed(client: &Client, error: &io::Error) -> Result<Ended, Failure> {
    if error.kind() == io::ErrorKind::BrokenPipe {
        // Whoever read it has seen enough, as in `| head`.
        return Ok(Ended::Enough);
    }
    if error.kind() == io::ErrorKind::InvalidData {
        let message = format!("what {} tells is not the state of a rig: {error}", client.base());
        return Err(Failure::Failed(message));
    }
    Err(cannot_write(error))
}

/// Why there is nothing more to see.
enum Ended {
    /// The person has seen enough.
    Enough,
    /// The rig hung up.
    Gone,
}

/// Shows every state, until the end is asked for or nothing more is told.
async fn follow(
    mut told: mpsc::Receiver<Event>,
    end: impl Future<Output = ()>,
    view: &mut View,
) -> io::Result<Ended> {
    tokio::pin!(end);
    loop {
        let event = tokio::select! {
            () = &mut end => return Ok(Ended::Enough),
            event = told.recv() => event,
        };
        match event {
            Some(event) if event.name == "state" => view.show(&event.data)?,
            Some(_) => {}
            None => return Ok(Ended::Gone),
        }
    }
}

/// Reads events in a thread of its own, since reading cannot be broken off.
fn spawn_reader<R: Read + Send + 'static>(events: Events<R>) -> io::Result<mpsc::Receiver<Event>> {
    let (send, receive) = mpsc::channel(1);
    let read = move || {
        for event in events.map_while(Result::ok) {
            if send.blocking_send(event).is_err() {
                return;
            }
        }
    };
    thread::Builder::new().name("events".into()).spawn(read)?;
    Ok(receive)
}

/// How it is shown.
enum View {
    /// As it comes.
    Json,
    /// A line for each change, with what was told last.
    Lines(Vec<Item>),
    /// A table that is redrawn.
    Live(Screen, HiddenCursor),
}

impl View {
    fn new(json: bool) -> io::Result<View> {
        Ok(match json {
            true => View::Json,
            false if io::stdout().is_terminal() => View::Live(Screen::new(), HiddenCursor::hide()?),
            false => View::Lines(Vec::new()),
        })
    }

    fn show(&mut self, state: &str) -> io::Result<()> {
        let text = match self {
            View::Json => format!("{state}\n"),
            View::Lines(before) => {
                let rig = read(state)?;
                let after = items(&rig);
                let lines = changes(before, &after, rig.now_ns);
                *before = after;
                lines
            }
            View::Live(screen, _) => screen.draw(&show::picture(&read(state)?), terminal::size()),
        };
        write_now(&text)
    }
}

fn read(state: &str) -> io::Result<RigState> {
    serde_json::from_str(state).map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))
}

/// Something that is told when it has changed: what it is, and how it is.
type Item = (String, String);

fn items(rig: &RigState) -> Vec<Item> {
    let clock = [("clock".to_owned(), format!("clock {}", rig.clock.mode))];
    let playing =
        rig.playing.as_ref().map_or("nothing is played".to_owned(), |name| format!("playing {name}"));
    let drives = rig.drives.iter().map(|drive| (drive.name.clone(), show::change(drive)));
    let wires = rig.wires.iter().map(|wire| {
        let (name, state) =
            (format!("{} {}", wire.from, wire.to), if wire.connected { "whole" } else { "cut" });
        (name.clone(), format!("{name}  {state}, {}", u8::from(wire.level)))
    });
    clock.into_iter().chain([("playing".to_owned(), playing)]).chain(drives).chain(wires).collect()
}

/// The lines of what is not as it was.
fn changes(before: &[Item], after: &[Item], now_ns: u64) -> String {
    let seconds = now_ns as f64 / 1e9;
    after.iter().filter(|item| !before.contains(item)).fold(String::new(), |mut text, (_, how)| {
        // Writing to a String does not fail.
        let _ = writeln!(text, "{seconds:13.6}  {how}");
        text
    })
}

/// What makes a heading stand out.
pub(crate) const BOLD: &str = "\x1b[1m";
/// What makes stand out what is wrong.
pub(crate) const RED: &str = "\x1b[31m";
const PLAIN: &str = "\x1b[0m";

/// A part of a terminal that is drawn again and again.
#[derive(Debug)]
pub(crate) struct Screen {
    /// How many lines were drawn last; none yet with 0.
    drawn: usize,
    colour: bool,
}

impl Screen {
    /// One on which nothing was drawn yet.
    pub(crate) fn new() -> Screen {
        Screen { drawn: 0, colour: !no_color() }
    }

    /// What draws a rig where it was drawn last.
    fn draw(&mut self, picture: &Picture, size: Option<Size>) -> String {
        let lines = self.lines(picture, size.map(|size| size.columns));
        self.redraw(lines, size)
    }

    /// What draws lines where lines were drawn last.
    pub(crate) fn redraw(&mut self, mut lines: Vec<String>, size: Option<Size>) -> String {
        if let Some(size) = size {
            fit(&mut lines, size.lines);
        }
        let mut text = match self.drawn {
            0 => String::new(),
            drawn => format!("\x1b[{drawn}A\r"),
        };
        for line in &lines {
            let _ = writeln!(text, "{line}\x1b[K");
        }
        text.push_str("\x1b[J");
        self.drawn = lines.len();
        text
    }

    /// A line in a colour, where colours are wanted, as long as there are columns.
    pub(crate) fn painted(&self, colour: &str, line: &str, columns: Option<usize>) -> String {
        let line = cut(line, columns);
        if self.colour { format!("{colour}{line}{PLAIN}") } else { line }
    }

    fn lines(&self, picture: &Picture, columns: Option<usize>) -> Vec<String> {
        let cut = |line: &str| cut(line, columns);
        let painted = |colour: &str, line: &str| self.painted(colour, line, columns);
        let mut lines = vec![cut(&picture.clock), String::new(), painted(BOLD, &picture.heading)];
        let drive = |(line, wrong): &(String, bool)| if *wrong { painted(RED, line) } else { cut(line) };
        lines.extend(picture.drives.iter().map(drive));
        if let Some((heading, wires)) = picture.wires.split_first() {
            lines.extend([String::new(), painted(BOLD, heading)]);
            lines.extend(wires.iter().map(|wire| cut(wire)));
        }
        lines
    }
}

/// A line as long as there are columns.
pub(crate) fn cut(line: &str, columns: Option<usize>) -> String {
    match columns {
        Some(columns) => line.chars().take(columns).collect(),
        None => line.to_owned(),
    }
}

/// Leaves out what a terminal of so many lines cannot show; the last is the cursor's.
fn fit(lines: &mut Vec<String>, most: usize) {
    let room = most.saturating_sub(1).max(1);
    if lines.len() > room {
        let hidden = lines.len() - (room - 1);
        lines.truncate(room - 1);
        lines.push(format!("and {hidden} lines more"));
    }
}

/// The cursor, which would flicker from line to line, is hidden for as long as this is kept.
#[derive(Debug)]
pub(crate) struct HiddenCursor(());

impl HiddenCursor {
    /// Hides it.
    pub(crate) fn hide() -> io::Result<HiddenCursor> {
        write_now("\x1b[?25l").map(HiddenCursor)
    }
}

impl Drop for HiddenCursor {
    fn drop(&mut self) {
        // Without a terminal there is no cursor to show.
        let _ = write_now("\x1b[?25h");
    }
}

/// Writes a part of a stream of results to stdout.
pub(crate) fn write_now(text: &str) -> io::Result<()> {
    let mut stdout = io::stdout().lock();
    stdout.write_all(text.as_bytes())?;
    stdout.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(drives: usize) -> Picture {
        Picture {
            clock: "clock real, rig time 1s".to_owned(),
            heading: "DRIVE  STATE".to_owned(),
            drives: (0..drives).map(|n| (format!("d{n}     READY"), n == 1)).collect(),
            wires: vec!["WIRE".to_owned(), "d0.relay".to_owned()],
        }
    }

    const USUAL: Option<Size> = Some(Size { columns: 80, lines: 24 });

    #[test]
    fn it_is_drawn_again_where_it_was() {
        let mut screen = Screen { drawn: 0, colour: false };
        let first = screen.draw(&picture(2), USUAL);
        assert!(first.starts_with("clock real"), "{first:?}");
        assert_eq!(first.matches('\n').count(), 8);
        let second = screen.draw(&picture(1), USUAL);
        assert!(second.starts_with("\x1b[8A\rclock real") && second.ends_with("\x1b[J"), "{second:?}");
        assert_eq!(screen.drawn, 7);
    }

    #[test]
    fn no_line_is_longer_and_there_are_no_more_of_them_than_the_terminal_has() {
        let mut screen = Screen { drawn: 0, colour: false };
        let text = screen.draw(&picture(50), Some(Size { columns: 10, lines: 8 }));
        let plain = text.replace("\x1b[K", "").replace("\x1b[J", "");
        let lines: Vec<&str> = plain.lines().collect();
        assert_eq!(lines.len(), 7);
        assert_eq!(lines[..4], ["clock real", "", "DRIVE  STA", "d0     REA"]);
        assert_eq!(lines[6], "and 50 lines more");
    }

    #[test]
    fn what_is_wrong_is_red_where_colour_is_wanted() {
        let mut screen = Screen { drawn: 0, colour: true };
        let text = screen.draw(&picture(2), None);
        assert!(
            text.contains("\x1b[31md1     READY\x1b[0m") && text.contains("\nd0     READY\x1b[K"),
            "{text:?}"
        );
    }

    #[test]
    fn only_what_has_changed_is_told() {
        let item = |name: &str, how: &str| (name.to_owned(), how.to_owned());
        let before = [item("a", "a  READY"), item("b", "b  READY")];
        let after = [item("a", "a  READY"), item("b", "b  busy")];
        assert_eq!(changes(&before, &after, 1_500_000_000), "     1.500000  b  busy\n");
        assert_eq!(changes(&[], &after, 0).lines().count(), 2);
    }
}
