//! The SMD3 on a virtual clock, topic by topic.

mod bench;
mod commands;
mod current;
mod faults;
mod flash;
mod heat;
mod homing;
mod joystick;
mod limits;
mod memory;
mod modes;
mod moves;
mod power;
mod properties;
mod quantities;
mod steps;
mod stops;
mod thermal;
