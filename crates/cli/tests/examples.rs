//! The programs in `examples/programs`, run on virtual time: each does what its comment says.
#![allow(clippy::float_cmp, reason = "a standing motor has speed 0 exactly")]

use std::fs;
use std::path::Path;
use std::time::Duration;
use stepdrive_asm::{Image, SourceFile, assemble};
use stepdrive_drive::smsd::Smsd;
use stepdrive_rig::any::AnyMachine;
use stepdrive_rig::file::{DEMO, RigFile};
use stepdrive_rig::group::Group;
use stepdrive_rig::machine::Machine;
use stepdrive_rig::simulation::{End, Signal, Simulation, State, Step, What};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::time::Instant;

const ENDLESS: &str = "[[drive]]\nname = \"a\"\nmodel = \"SMSD-4.2LAN\"\nmodbus_tcp = \"127.0.0.1:0\"\n";

fn image(example: &str) -> Image {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/programs");
    let text = fs::read_to_string(folder.join(example)).expect("the example is there");
    assemble(&SourceFile::new(example, text)).image.expect("the example has no errors")
}

fn machine(rig: &str, image: &Image) -> Machine<Smsd> {
    let rig = RigFile::parse(rig).expect("a valid rig");
    let drive = &rig.drives[0];
    drive.smsd().expect("an SMSD").start_program(drive, std::array::from_fn(|memory| image.area(memory)), 0)
}

fn at(seconds: f64) -> Instant {
    Instant::ZERO + Duration::from_secs_f64(seconds)
}

/// A signal that is present between two times, in seconds.
fn pulse(input: Input, from: f64, to: f64) -> [Signal; 2] {
    [Signal { at: at(from), input, present: true }, Signal { at: at(to), input, present: false }]
}

/// What an example does on a rig, with these signals, for so many seconds.
fn play(example: &str, rig: &str, signals: &[Signal], seconds: u64) -> Vec<Step> {
    let machine = machine(rig, &image(example));
    Simulation::new(machine, signals.to_vec(), Duration::from_secs(seconds)).collect()
}

/// The state when an instruction ran, every time it did.
fn when(steps: &[Step], opcode: Opcode) -> Vec<State> {
    let is = |word| Instruction::from_word(word).is_ok_and(|instruction| instruction.opcode == opcode);
    let ran = steps.iter().filter(|step| matches!(step.what, What::Instruction(_, word) if is(word)));
    ran.map(|step| step.state).collect()
}

fn positions(states: &[State]) -> Vec<i32> {
    states.iter().map(|state| state.position).collect()
}

fn end(steps: &[Step]) -> (End, State) {
    let last = steps.last().expect("at least the end");
    let What::End(end) = last.what else { panic!("the last step is the end") };
    (end, last.state)
}

#[test]
fn shuttle_goes_a_hundred_times_and_lets_the_motor_go() {
    let steps = play("shuttle.smsd", DEMO, &[], 3600);
    let (end, state) = end(&steps);
    assert!(matches!(end, End::Ended(_)), "{end:?}");
    assert!(state.status.hi_z && state.position == 0);
    assert_eq!(positions(&when(&steps, Opcode::SetWait)), [32_000; 100]);
    assert_eq!(positions(&when(&steps, Opcode::SetWait2)), [0; 100]);
}

#[test]
fn shuttle_ends_early_when_it_is_asked_to() {
    // The first dwell at the start begins after about 4.4 s and would last for two.
    let steps = play("shuttle.smsd", DEMO, &pulse(Input::In0, 5.0, 7.0), 3600);
    let (end, state) = end(&steps);
    assert!(matches!(end, End::Ended(_)), "{end:?}");
    assert_eq!(state.position, 0);
    assert!(state.at < at(5.1), "{}", state.at);
}

#[test]
fn home_and_index_homes_and_turns_an_eighth_at_every_signal() {
    let signals: Vec<Signal> =
        (0..8).flat_map(|n| pulse(Input::In0, f64::from(n) + 2.0, f64::from(n) + 2.1)).collect();
    let steps = play("home-and-index.smsd", DEMO, &signals, 12);
    assert_eq!(positions(&when(&steps, Opcode::MoveF)), [0, 400, 800, 1200, 1600, 2000, 2400, 2800]);
    assert_eq!(when(&steps, Opcode::ScanZeroR).len(), 2, "it homes again after a turn");
    // The motion is the same every time, to the nanosecond.
    let settled = when(&steps, Opcode::SetWait);
    let took = |n: usize| settled[n].at.since(at(2.0 + n as f64));
    assert!((1..8).all(|n| took(n) == took(0)), "{settled:?}");
}

#[test]
fn feed_until_mark_cuts_where_the_mark_was_seen() {
    let signals =
        [pulse(Input::In1, 2.0, 2.5), pulse(Input::Continue, 4.0, 4.1), pulse(Input::In1, 6.0, 6.5)].concat();
    let steps = play("feed-until-mark.smsd", ENDLESS, &signals, 8);
    let cuts = when(&steps, Opcode::SetRele);
    assert_eq!(cuts.len(), 2);
    for (cut, seen) in cuts.iter().zip([2.0, 6.0]) {
        let mark = steps.iter().find(|step| step.state.at == at(seen)).expect("the signal is a step");
        assert_eq!(cut.position, mark.state.position);
        assert!(cut.relay && cut.status.ready);
    }
    let opened = when(&steps, Opcode::ClrRele);
    assert_eq!(opened[0].at.since(cuts[0].at), Duration::from_millis(151));
}

#[test]
fn jog_follows_the_buttons() {
    let signals = [pulse(Input::In0, 1.0, 2.0), pulse(Input::In1, 4.0, 4.5)].concat();
    let machine = machine(ENDLESS, &image("jog.smsd"));
    let mut simulation = Simulation::new(machine, signals, Duration::from_secs(8));
    let mut last_before = |seconds: f64| {
        let before = simulation.by_ref().take_while(|step| step.state.at < at(seconds));
        before.last().expect("it looks every 20 ms").state
    };
    assert_eq!(last_before(0.9).speed, 0.0);
    let forward = last_before(1.9);
    assert!((forward.speed - 400.0).abs() < 0.1 && forward.status.forward, "{forward:?}");
    assert_eq!(last_before(3.9).speed, 0.0);
    let backward = last_before(4.45);
    assert!((backward.speed - 400.0).abs() < 10.0 && !backward.status.forward, "{backward:?}");
    assert_eq!(last_before(7.9).speed, 0.0);
}

#[test]
fn menu_does_what_the_switches_say() {
    let both = [pulse(Input::In0, 1.0, 1.2), pulse(Input::In1, 1.0, 1.2)].concat();
    for (signals, area) in
        [(pulse(Input::In0, 1.0, 1.2).to_vec(), 1), (pulse(Input::In1, 1.0, 1.2).to_vec(), 2), (both, 3)]
    {
        let steps = play("menu.smsd", ENDLESS, &signals, 60);
        let areas: Vec<u8> = steps
            .iter()
            .filter_map(|step| match step.what {
                What::Instruction(place, _) => Some(place.area),
                What::Change | What::End(_) => None,
            })
            .collect();
        assert!(
            areas.contains(&area) && areas.iter().all(|other| [0, area].contains(other)),
            "memory {area}"
        );
        let (end, state) = end(&steps);
        assert!(matches!(end, End::TimeOver(place) if place.area == 0), "{end:?}");
        assert!(state.status.hi_z, "it rests again");
    }
}

#[test]
fn retry_gives_up_after_three_times_and_calls_a_person() {
    let steps = play("retry.smsd", ENDLESS, &pulse(Input::In1, 1.0, 1.5), 120);
    let stroke = when(&steps, Opcode::GoTo).len();
    assert_eq!(stroke, 3);
    let (end, state) = end(&steps);
    assert!(matches!(end, End::Waiting(_, inputs) if inputs == Input::In1.bit()), "{end:?}");
    assert!(state.relay && state.position == 0);
}

#[test]
fn retry_is_content_with_a_confirmed_part() {
    let signals = [pulse(Input::In1, 1.0, 1.5), pulse(Input::In0, 2.0, 60.0)].concat();
    let steps = play("retry.smsd", ENDLESS, &signals, 120);
    assert_eq!(when(&steps, Opcode::GoTo).len(), 1);
    assert_eq!(when(&steps, Opcode::SetRele).len(), 2, "two blinks");
    assert!(!end(&steps).1.relay);
}

/// Two controllers whose relays are wired to each other's CONTINUE input, each with its example running.
fn pair(examples: [&str; 2]) -> Group {
    let drive = |name| {
        format!("[[drive]]\nname = \"{name}\"\nmodel = \"SMSD-4.2LAN\"\nmodbus_tcp = \"127.0.0.1:0\"\n")
    };
    let wire = |from, to| format!("[[wire]]\nfrom = \"{from}.relay\"\nto = \"{to}.CONTINUE\"\n");
    let rig = [drive("a"), drive("b"), wire("a", "b"), wire("b", "a")].concat();
    let rig = RigFile::parse(&rig).expect("a valid rig");
    let machines = examples.map(|example| AnyMachine::Smsd(Box::new(machine(ENDLESS, &image(example)))));
    Group::new(machines.into_iter().enumerate().collect(), &rig.wires, rig.seed)
}

#[test]
fn the_leader_and_the_follower_meet_after_every_move() {
    let mut pair = pair(["step-together-leader.smsd", "step-together-follower.smsd"]);
    let mut meetings = Vec::new();
    let mut were_together = false;
    while meetings.len() < 22 {
        let wake = pair.next_wake().expect("neither waits for ever");
        let now = pair.advance(wake, &mut u32::MAX.clone());
        let axes = [0, 1].map(|axis| pair.members()[axis].machine().smsd().expect("an SMSD").drive());
        let together = axes.iter().all(|axis| axis.relay());
        if together && !were_together {
            meetings.push(axes.map(|axis| axis.position(now)));
        }
        were_together = together;
    }
    let there = (1..=10).map(|n| [n * 3200, n * 1600]);
    let twice: Vec<[i32; 2]> = there.chain([[0, 0]]).cycle().take(22).collect();
    assert_eq!(meetings, twice);
}
