//! The SMD3 on a virtual clock, topic by topic.

mod bench;
mod commands;
mod current;
mod faults;
mod homing;
mod joystick;
mod limits;
mod memory;
mod modes;
mod moves;
mod properties;
mod steps;
mod stops;
mod thermal;
