//! Exact, event-driven motion of a stepper motor axis.
