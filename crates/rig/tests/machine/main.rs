//! Controllers with their mechanics and switches on a virtual clock.

mod bench;
mod ends;
mod homing;
mod scripts;
mod stalls;
mod switches;
