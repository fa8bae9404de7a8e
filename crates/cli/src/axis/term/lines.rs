//! Where the lines of a terminal come from.

use rustyline::DefaultEditor;
use std::io::{self, BufRead, Read};
use std::sync::mpsc as wanted;
use std::thread;
use tokio::sync::mpsc;

/// The longest line that is read, bytes; the rest of a longer one is a line of its own.
const LONGEST: u64 = 4096;

/// Lines, read in a thread of its own, since reading cannot be broken off. One is read when it is asked for, so that
/// what a terminal is shown in between stands above the line that is being typed.
pub(super) struct Lines {
    wanted: wanted::Sender<()>,
    read: mpsc::Receiver<String>,
    #[cfg(unix)]
    _settings: Settings,
}

impl Lines {
    /// Lines from stdin; those of a person at a terminal can be edited, and called back.
    pub(super) fn start(at_terminal: bool) -> io::Result<Lines> {
        let (wanted, asked) = wanted::channel();
        let (send, read) = mpsc::channel(1);
        #[cfg(unix)]
        let settings = Settings::now();
        let mut source = Source::new(at_terminal);
        let work = move || {
            while asked.recv().is_ok() {
                let Some(line) = source.next() else { return };
                if send.blocking_send(line).is_err() {
                    return;
                }
            }
        };
        thread::Builder::new().name("stdin".into()).spawn(work)?;
        Ok(Lines {
            wanted,
            read,
            #[cfg(unix)]
            _settings: settings,
        })
    }

    /// The next line; `None` when there are no more.
    pub(super) async fn next(&mut self) -> Option<String> {
        // When the thread has ended there is nothing to read either.
        let _ = self.wanted.send(());
        self.read.recv().await
    }
}

enum Source {
    Plain,
    Edited(Box<DefaultEditor>),
}

impl Source {
    fn new(at_terminal: bool) -> Source {
        // A terminal that cannot be edited on is read as anything else.
        let editor = at_terminal.then(DefaultEditor::new).and_then(Result::ok);
        editor.map_or(Source::Plain, |editor| Source::Edited(Box::new(editor)))
    }

    fn next(&mut self) -> Option<String> {
        match self {
            Source::Plain => read_line(&mut io::stdin().lock()).ok().flatten(),
            Source::Edited(editor) => {
                // Ctrl-C and Ctrl-D end it like the end of a file.
                let line = editor.readline("> ").ok()?;
                // What is not kept cannot be called back, and that is all.
                let _ = editor.add_history_entry(&line);
                Some(line)
            }
        }
    }
}

/// The next line, or the beginning of one that is too long; `None` at the end.
fn read_line(input: &mut impl BufRead) -> io::Result<Option<String>> {
    let mut bytes = Vec::new();
    let count = input.take(LONGEST).read_until(b'\n', &mut bytes)?;
    Ok((count > 0).then(|| String::from_utf8_lossy(&bytes).trim_end_matches(['\r', '\n']).to_owned()))
}

/// The settings of the terminal, as they were. Editing changes them, and may be broken off by a signal.
#[cfg(unix)]
struct Settings(Option<rustix::termios::Termios>);

#[cfg(unix)]
impl Settings {
    fn now() -> Settings {
        Settings(rustix::termios::tcgetattr(io::stdin()).ok())
    }
}

#[cfg(unix)]
impl Drop for Settings {
    fn drop(&mut self) {
        if let Some(settings) = &self.0 {
            // A terminal that has gone needs no settings.
            let now = rustix::termios::OptionalActions::Now;
            let _ = rustix::termios::tcsetattr(io::stdin(), now, settings);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_whatever_ends_them() {
        let mut input = &b"SER\r\nFW\n\xFF"[..];
        let mut next = || read_line(&mut input).expect("readable");
        assert_eq!(next().as_deref(), Some("SER"));
        assert_eq!(next().as_deref(), Some("FW"));
        assert_eq!(next().as_deref(), Some("\u{FFFD}"));
        assert_eq!(next(), None);
    }

    #[test]
    fn no_line_is_too_long() {
        let long = vec![b'a'; 10_000];
        let mut input = &long[..];
        let mut length = 0;
        while let Some(line) = read_line(&mut input).expect("readable") {
            assert!(line.len() <= 4096);
            length += line.len();
        }
        assert_eq!(length, 10_000);
    }
}
