//! Times and counts that belong to the controller as a whole.

use core::time::Duration;

/// After a failed authorisation, attempts within this time are not evaluated (ch. 3).
pub const AUTHORISATION_LOCKOUT: Duration = Duration::from_secs(1);

/// ASSUMED: how long a `MEM_CMD` procedure works on the FRAM before it sets `B_COMPLETE`.
pub const FRAM_TIME: Duration = Duration::from_millis(2);

/// TCP connections served at a time: the W5500 network chip has 8 sockets (decision). A ninth is closed at once.
pub const MAX_CONNECTIONS: usize = 8;

/// ASSUMED: a client that stays silent in the middle of a request is disconnected after this time, so that it does
/// not keep one of the 8 sockets for ever.
pub const HALF_FRAME_TIMEOUT: Duration = Duration::from_secs(10);

/// ASSUMED: a client that does not take its replies is disconnected after this time.
pub const UNREAD_REPLY_TIMEOUT: Duration = Duration::from_secs(10);

/// ASSUMED: the least time that an instruction of a program takes, so that no loop runs in no time (decision 22).
pub const INSTRUCTION_TIME: Duration = Duration::from_millis(1);

/// ASSUMED: how many subprograms may be called without having returned (decision 23).
pub const CALL_DEPTH: usize = 16;

/// ASSUMED: how many loops may be open (decision 23).
pub const LOOP_DEPTH: usize = 8;
