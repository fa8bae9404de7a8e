//! Notices: what those who watch are told when something ends otherwise than wanted.

use serde::Serialize;
use tokio::sync::broadcast;

/// How many are kept for a client that reads slowly; of more it misses the oldest.
const KEPT: usize = 256;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Level {
    /// Good to know.
    Info,
    /// Something has to be done.
    Error,
}

/// One notice.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Notice {
    /// Which axis it is about.
    pub(crate) name: String,
    pub(crate) level: Level,
    pub(crate) text: String,
}

/// Where notices go.
#[derive(Clone, Debug)]
pub(crate) struct Notices(broadcast::Sender<Notice>);

impl Notices {
    pub(crate) fn new() -> Notices {
        Notices(broadcast::Sender::new(KEPT))
    }

    /// Tells all who watch.
    pub(crate) fn tell(&self, name: &str, level: Level, text: String) {
        // With nobody watching there is nobody to tell.
        let _ = self.0.send(Notice { name: name.to_owned(), level, text });
    }

    /// All that are told from now on.
    pub(crate) fn listen(&self) -> broadcast::Receiver<Notice> {
        self.0.subscribe()
    }
}
