//! Scenarios: what is refused, what is done when, and what is told about it.
#![allow(clippy::needless_pass_by_value, reason = "an `Expect` is written in place")]

mod acts;
mod examples;
mod headless;
mod mistakes;
mod report;
mod running;
