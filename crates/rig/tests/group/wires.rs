//! What a wire carries.

use crate::bench::{Bench, MS, PAIR, SECOND};
use stepdrive_spec::smsd::registers::Reg;

/// The relay of `a`, wired to two inputs of `b`: one late, one inverted.
const ONE_TO_TWO: &str = r#"
[[drive]]
name = "a"
model = "SMSD-4.2LAN"
modbus_tcp = "127.0.0.1:0"
[[drive]]
name = "b"
model = "SMSD-4.2LAN"
modbus_tcp = "127.0.0.1:0"
[[wire]]
from = "a.relay"
to = "b.IN0"
delay = "5ms"
[[wire]]
from = "a.relay"
to = "b.IN1"
invert = true
"#;

#[test]
fn a_wire_carries_the_relay_to_the_input_at_once() {
    let mut bench = Bench::new(PAIR, &[]);
    bench.pass(SECOND);
    bench.write("a", Reg::Relay, 1);
    assert_eq!(bench.look("b.CONTINUE"), 1.0);
    bench.write("a", Reg::Relay, 0);
    assert_eq!(bench.look("b.CONTINUE"), 0.0);
}

#[test]
fn an_inverted_wire_gives_its_signal_from_the_start() {
    let mut bench = Bench::new(ONE_TO_TWO, &[]);
    assert_eq!([bench.look("b.IN0"), bench.look("b.IN1")], [0.0, 1.0]);
    bench.write("a", Reg::Relay, 1);
    assert_eq!([bench.look("b.IN0"), bench.look("b.IN1")], [0.0, 0.0]);
}

#[test]
fn a_wire_with_a_delay_gives_every_edge_that_much_later() {
    let mut bench = Bench::new(ONE_TO_TWO, &[]);
    bench.write("a", Reg::Relay, 1);
    bench.pass(2 * MS);
    bench.write("a", Reg::Relay, 0);
    for (at, level) in [(4, 0.0), (5, 1.0), (6, 1.0), (7, 0.0), (8, 0.0)] {
        let mut late = bench.clone();
        late.pass((at - 2) * MS);
        assert_eq!(late.look("b.IN0"), level, "after {at} ms");
    }
}

#[test]
fn a_cut_wire_gives_nothing_and_once_mended_what_is_there() {
    let mut bench = Bench::new(ONE_TO_TWO, &[]);
    bench.act("wire a.relay b.IN1 cut");
    assert_eq!(bench.look("b.IN1"), 0.0);
    bench.write("a", Reg::Relay, 1);
    bench.write("a", Reg::Relay, 0);
    assert_eq!(bench.look("b.IN1"), 0.0);
    bench.act("wire a.relay b.IN1 mend");
    assert_eq!(bench.look("b.IN1"), 1.0);
}

#[test]
fn a_relay_falls_off_with_the_supply() {
    let mut bench = Bench::new(PAIR, &[]);
    bench.write("a", Reg::Relay, 1);
    bench.act("power a off");
    assert_eq!(bench.look("b.CONTINUE"), 0.0);
    bench.act("power a on");
    assert_eq!(bench.look("b.CONTINUE"), 0.0, "the relay is off at power-up");
}

#[test]
fn an_input_that_is_forced_does_not_see_its_wire() {
    let mut bench = Bench::new(PAIR, &[]);
    bench.act("input b.CONTINUE 0");
    bench.write("a", Reg::Relay, 1);
    assert_eq!(bench.look("b.CONTINUE"), 0.0);
    bench.act("input b.CONTINUE release");
    assert_eq!(bench.look("b.CONTINUE"), 1.0);
}
