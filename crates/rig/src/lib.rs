//! The world around the controllers: motors, mechanics, switches.
