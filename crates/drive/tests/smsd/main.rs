//! The SMSD on a virtual clock, topic by topic.

mod access;
mod bench;
mod electrical;
mod flow;
mod inputs;
mod instructions;
mod moves;
mod program_control;
mod programs;
mod properties;
mod refusals;
mod registers;
mod runs;
mod stops;
