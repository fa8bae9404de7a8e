//! The behaviour of the controllers: registers, motion, inputs, faults, programs.
