//! What may go wrong on that bench.

pub(crate) use crate::bench::common::link::Fault;
