//! Server-sent events, as in the HTML standard: fields in lines, an empty line behind each event.

use std::io::{self, BufRead, BufReader, Read};

/// The most bytes in a line of an event: more than the state of any rig has.
const LONGEST_LINE: u64 = 256 << 20;

/// Something that the rig told.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Event {
    /// What kind of thing it is; `message` when it does not say.
    pub(super) name: String,
    /// What it tells.
    pub(super) data: String,
}

/// The events of a stream, until it ends.
pub(super) struct Events<R>(BufReader<R>);

impl<R: Read> Events<R> {
    /// The events in these bytes.
    pub(super) fn new(bytes: R) -> Events<R> {
        Events(BufReader::new(bytes))
    }

    fn line(&mut self) -> io::Result<Option<String>> {
        let mut line = String::new();
        if (&mut self.0).take(LONGEST_LINE).read_line(&mut line)? == 0 {
            return Ok(None);
        }
        let end = line.trim_end_matches(['\r', '\n']).len();
        line.truncate(end);
        Ok(Some(line))
    }

    fn event(&mut self) -> io::Result<Option<Event>> {
        let (mut name, mut data) = (None, Vec::new());
        while let Some(line) = self.line()? {
            match line.split_once(':').unwrap_or((&line, "")) {
                ("event", value) => name = Some(field(value).to_owned()),
                ("data", value) => data.push(field(value).to_owned()),
                ("", "") if line.is_empty() && !data.is_empty() => {
                    let name = name.unwrap_or_else(|| "message".to_owned());
                    return Ok(Some(Event { name, data: data.join("\n") }));
                }
                // An event without data is none; a line that begins with a colon keeps the connection alive.
                ("", _) if line.is_empty() => name = None,
                _ => {}
            }
        }
        Ok(None)
    }
}

/// The value of a field, without the space that may stand before it.
fn field(value: &str) -> &str {
    value.strip_prefix(' ').unwrap_or(value)
}

impl<R: Read> Iterator for Events<R> {
    type Item = io::Result<Event>;

    fn next(&mut self) -> Option<io::Result<Event>> {
        self.event().transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn events(text: &str) -> Vec<(String, String)> {
        let events = Events::new(text.as_bytes()).map(|event| event.expect("readable"));
        events.map(|event| (event.name, event.data)).collect()
    }

    fn event(name: &str, data: &str) -> (String, String) {
        (name.to_owned(), data.to_owned())
    }

    #[test]
    fn events_are_read_with_their_names() {
        let text = "event: state\ndata: {\"a\":1}\n\nevent:report\r\ndata:{}\r\n\r\n";
        assert_eq!(events(text), [event("state", "{\"a\":1}"), event("report", "{}")]);
    }

    #[test]
    fn data_may_have_several_lines_and_colons() {
        assert_eq!(events("data: a: b\ndata\ndata:  c\n\n"), [event("message", "a: b\n\n c")]);
    }

    #[test]
    fn comments_unknown_fields_and_events_without_data_are_passed_over() {
        let text = ": alive\n\n:\nevent: lost\n\nid: 7\nretry: 5\nx\ndata: kept\n\n";
        assert_eq!(events(text), [event("message", "kept")]);
    }

    #[test]
    fn an_event_that_was_not_finished_is_none() {
        assert_eq!(events("event: state\ndata: {}\n"), []);
        assert_eq!(events(""), []);
    }

    #[test]
    fn what_is_no_text_is_an_error() {
        let mut events = Events::new(&b"data: \xFF\n\n"[..]);
        assert!(events.next().expect("something").is_err());
    }
}
