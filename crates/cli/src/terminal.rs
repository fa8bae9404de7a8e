//! What a person at a terminal, or a program behind a pipe, is shown.

use crate::Failure;
use std::io::{self, Write};

/// Writes a result to stdout. A reader that has gone, as in `stepdrive example-rig | head -1`, is no failure.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(cannot_write(&error)),
        _ => Ok(()),
    }
}

/// Writes a result as a line of JSON.
pub(crate) fn print_json(value: &impl serde::Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string(value).map_err(|error| Failure::Failed(error.to_string()))?;
    print(&(text + "\n"))
}

/// Talks to the person at the terminal.
pub(crate) fn tell(text: &str) {
    if !text.is_empty() {
        // Without a stderr there is nobody to tell.
        let _ = writeln!(io::stderr(), "{text}");
    }
}

/// The results cannot be written.
pub(crate) fn cannot_write(error: &io::Error) -> Failure {
    Failure::Failed(format!("cannot write to stdout: {error}"))
}

/// Whether the person wants no colour (no-color.org).
#[allow(clippy::disallowed_methods, reason = "NO_COLOR is a variable of the environment and nothing else")]
pub(crate) fn no_color() -> bool {
    std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty())
}

/// How large a terminal is, in characters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Size {
    /// How many characters a line has.
    pub(crate) columns: usize,
    /// How many lines there are.
    pub(crate) lines: usize,
}

/// How large the terminal at stdout is; `None` when nobody knows.
#[cfg(unix)]
pub(crate) fn size() -> Option<Size> {
    let size = rustix::termios::tcgetwinsize(io::stdout()).ok()?;
    let known = size.ws_col > 0 && size.ws_row > 0;
    known.then(|| Size { columns: size.ws_col.into(), lines: size.ws_row.into() })
}

/// How large the terminal at stdout is: nobody knows here.
#[cfg(not(unix))]
pub(crate) fn size() -> Option<Size> {
    None
}
