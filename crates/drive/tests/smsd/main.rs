//! The SMSD on a virtual clock, topic by topic.

mod access;
mod bench;
mod electrical;
mod flow;
mod inputs;
mod instructions;
mod moves;
mod power;
mod program_control;
mod programs;
mod properties;
mod protection;
mod quantities;
mod refusals;
mod registers;
mod runs;
mod standard;
mod step_clock;
mod stops;
