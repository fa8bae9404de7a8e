//! Bytes in and out for both ends of each protocol.
