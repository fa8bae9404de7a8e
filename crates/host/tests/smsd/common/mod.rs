//! A controller at the end of a link in memory that can be made to fail, whatever protocol is spoken on it.

pub(crate) mod link;
pub(crate) mod station;
