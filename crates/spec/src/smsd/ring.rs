//! The position counter: 22 bits, two's complement, a ring (ch. 4.2, `TARGET_POS`; decision: wrap and way round).

/// How many positions the ring has: 2^22.
pub const SIZE: i64 = 1 << 22;
/// Lowest position, in microsteps.
pub const MIN: i32 = -(1 << 21);
/// Highest position, in microsteps.
pub const MAX: i32 = (1 << 21) - 1;

/// The position on the ring of an unwrapped count of microsteps.
pub const fn wrap(count: i64) -> i32 {
    let shifted = (count + SIZE / 2).rem_euclid(SIZE) - SIZE / 2;
    // Within MIN..=MAX by construction.
    #[allow(clippy::cast_possible_truncation, reason = "a remainder of 2^22 fits in 32 bits")]
    let position = shifted as i32;
    position
}

/// Microsteps from `from` forward to `to`: 0 up to 2^22 - 1.
pub const fn forward(from: i32, to: i32) -> i64 {
    (to as i64 - from as i64).rem_euclid(SIZE)
}

/// Microsteps from `from` backward to `to`, as a number that is zero or negative: -(2^22 - 1) up to 0.
pub const fn reverse(from: i32, to: i32) -> i64 {
    -forward(to, from)
}

/// Microsteps from `from` to `to` the shorter way, negative backward. Exactly half the ring goes backward (decision).
pub const fn shortest(from: i32, to: i32) -> i64 {
    let ahead = forward(from, to);
    if ahead < SIZE / 2 { ahead } else { ahead - SIZE }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ring_closes_between_its_highest_and_lowest_position() {
        assert_eq!(wrap(i64::from(MAX)), MAX);
        assert_eq!(wrap(i64::from(MAX) + 1), MIN);
        assert_eq!(wrap(i64::from(MIN) - 1), MAX);
        assert_eq!(wrap(5 * SIZE - 3), -3);
    }

    #[test]
    fn the_shorter_way_may_cross_the_end_of_the_ring() {
        assert_eq!(shortest(MAX, MIN), 1);
        assert_eq!(shortest(MIN, MAX), -1);
        assert_eq!(shortest(0, 100), 100);
        assert_eq!(shortest(0, -100), -100);
    }

    #[test]
    fn exactly_half_way_goes_backward() {
        assert_eq!(shortest(0, MIN), -SIZE / 2);
        assert_eq!(shortest(1, MIN + 1), -SIZE / 2);
    }

    #[test]
    fn a_forced_direction_goes_all_the_way_round() {
        assert_eq!(forward(10, 9), SIZE - 1);
        assert_eq!(reverse(9, 10), -(SIZE - 1));
        assert_eq!(forward(9, 9), 0);
        assert_eq!(reverse(9, 9), 0);
    }
}
