//! How far something has come, for a person who waits.

use std::io::{self, IsTerminal, Write};

/// How many characters the bar has.
const WIDTH: usize = 30;

/// A line on stderr that is drawn again and again, where stderr is a terminal. It is gone when this is dropped.
#[derive(Debug)]
pub(crate) struct Progress {
    what: String,
    /// What is on the line now; `None` where nobody looks.
    drawn: Option<String>,
}

impl Progress {
    /// Of something that is called `what`, as in `storing`.
    pub(crate) fn new(what: impl Into<String>) -> Progress {
        Progress { what: what.into(), drawn: io::stderr().is_terminal().then(String::new) }
    }

    /// Shows that so much of it all is done.
    pub(crate) fn show(&mut self, done: usize, of: usize) {
        let Some(drawn) = &mut self.drawn else { return };
        let line = line(&self.what, done, of);
        if *drawn != line {
            put(&format!("\r{line}\x1b[K"));
            *drawn = line;
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.drawn.as_ref().is_some_and(|line| !line.is_empty()) {
            put("\r\x1b[K");
        }
    }
}

fn put(text: &str) {
    let mut stderr = io::stderr().lock();
    // Without a stderr there is nobody to show it to.
    let _ = stderr.write_all(text.as_bytes()).and_then(|()| stderr.flush());
}

fn line(what: &str, done: usize, of: usize) -> String {
    let of = of.max(1);
    let done = done.min(of);
    let full = WIDTH * done / of;
    format!("{what} [{}{}] {:3} %", "#".repeat(full), "-".repeat(WIDTH - full), 100 * done / of)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_is_as_full_as_it_is_done() {
        assert_eq!(line("storing", 0, 4), format!("storing [{}]   0 %", "-".repeat(30)));
        assert_eq!(line("storing", 2, 4), format!("storing [{}{}]  50 %", "#".repeat(15), "-".repeat(15)));
        for (done, of) in [(4, 4), (9, 4), (1, 0)] {
            assert!(line("storing", done, of).ends_with("#] 100 %"), "{done} of {of}");
        }
    }
}
