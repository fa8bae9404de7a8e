//! Exact, event-driven motion of a stepper motor axis: from a target and limits to segments of constant acceleration
//! and the instants at which something is crossed, with an independent checker.
//!
//! # The model
//!
//! A position is a *count*: a whole number of microsteps, unwrapped. The generator moves in *legs* of one direction.
//! Within a leg `count = origin ± floor(s(t))`, where `s(t) ≥ 0` is the distance the generator has covered. A leg
//! that is planned anew in flight starts from the present count with the fraction it had. Where a leg ends at a
//! standstill the fraction is dropped, because the rotor stands on the last microstep that was emitted; so a move of
//! `n` counts from a standstill ends exactly `n` away.
//!
//! # The stages
//!
//! 1. [`Limits`]: speeds and accelerations in counts, clamped into a range in which no plan can overflow.
//! 2. [`Profile`]: the plan of one leg, at most [`MAX_SEGMENTS`] [`Segment`]s, in seconds and counts from its start.
//!    It answers where, how fast, and when a count or a speed is crossed.
//! 3. [`Axis`]: legs put together into runs, moves, reversals and stops on the rig's clock.
//! 4. [`check`]: recomputes any profile without the planner's formulas and says what is wrong with it.
//!
//! Nothing is ticked: a profile is evaluated at any nanosecond in closed form, and an instant at which a count is
//! reached is solved for and then confirmed against the evaluation itself. Floating point is used with `+ - * /` and a
//! correctly rounded square root only, so the same inputs give the same bits on every machine.
//!
//! This crate is `no_std`, allocates nothing, reads no clock and does no I/O. No input makes it panic.
#![no_std]
#![cfg_attr(
    not(test),
    deny(
        clippy::arithmetic_side_effects,
        clippy::as_conversions,
        clippy::expect_used,
        clippy::indexing_slicing,
        clippy::panic,
        clippy::unwrap_used
    )
)]
#![allow(clippy::float_cmp, reason = "where numbers are compared for equality here, the same bits are meant")]

#[cfg(test)]
extern crate std;

mod axis;
pub mod check;
mod leg;
mod limits;
mod num;
mod plan;
mod profile;
mod segment;
mod violation;

pub use axis::{Axis, Goal, MAX_COUNT};
pub use leg::Direction;
pub use limits::{FASTEST, Limits, SLOWEST, STEEPEST};
pub use profile::{Crossing, MAX_SEGMENTS, Profile};
pub use segment::{Phase, Segment};
