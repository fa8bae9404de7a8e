//! Puts a rig on the network and keeps its non-volatile memory.
