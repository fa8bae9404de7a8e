"""The rig's clock, and clients that stay connected whatever it does."""

import threading
import time

import pytest

from control import SECOND_NS, running
from controller import *

# The motor chip turns a little faster than at the 100 steps/s that it is asked for.
STEPS_PER_SECOND = 107


@pytest.fixture
def rig(tmp_path):
    with running(tmp_path) as rig:
        yield rig


@pytest.fixture
def control(rig):
    return rig.control


@pytest.fixture
def a(rig):
    """A connection to the drive `a` that is logged in."""
    return rig.logged_in("a")


def test_at_a_hundred_times_the_speed_a_move_of_ten_seconds_takes_a_tenth_of_one(control, a):
    a.write(MAX_SPEED, 100)
    a.write_many(TARGET_POS, words(1000 * MICRO))
    asked = time.monotonic()
    before = control.clock("x100")
    began = time.monotonic()
    a.command(MOVE_F)
    a.wait_ready()
    took = time.monotonic() - began
    rig_time = (control.now() - before) / SECOND_NS
    in_all = time.monotonic() - asked
    assert a.position() == 1000 * MICRO
    assert 1000 / STEPS_PER_SECOND < rig_time
    assert took < 0.5
    assert 99 * took < rig_time < 101 * in_all
    assert control.get("/v1/rig")["clock"]["speed_reached"] > 0.9


def test_while_the_clock_is_paused_positions_stand_and_clients_are_answered(rig, control, a):
    uhv = rig.serial()
    a.command(RUN_F, speed=1000)
    uhv.do("RUNV,+")
    control.step("500ms")
    stood = control.now()
    places = {(a.position(), uhv.get("PACT")) for _ in range(50)}
    assert len(places) == 1
    (place,) = places
    assert place[0] > 400 * MICRO and place[1] > 0
    a.write(MAX_SPEED, 900)
    assert a.holding(MAX_SPEED, 1) == [900], "whatever takes no time can be done"
    assert uhv.ask("BAKET,77").data == "77"
    assert control.now() == stood


def test_a_step_is_exact(control, a):
    a.command(RUN_F, speed=1000)
    control.step("100ms")
    assert a.speed() == 1000
    places = [a.position()]
    before = control.now()
    for time_on in ["1s", "250ms", "1ms", "500us", "0.25ms"]:
        control.step(time_on)
        places.append(a.position())
    assert control.now() - before == 1_251_750_000
    assert [after - before for before, after in zip(places, places[1:])] == [16_000, 4_000, 16, 8, 4]


def test_a_run_ends_where_its_condition_begins_to_hold(rig, control, a):
    a.command(MOVE_F, 10_000)
    control.run_until("a.IN1")
    assert a.position() == 300 * MICRO
    control.run_until("a.ABS_POS >= 5000")
    assert a.position() == 5000
    control.run_until("idle")
    assert (a.position(), a.flag(READY)) == (10_000, True)
    assert not control.comes_about("a.ABS_POS > 10000", "5s"), "it stands"
    uhv = rig.serial()
    uhv.ask("MODE,4")
    uhv.do("RUNB")
    control.run_until("uhv.TMOT >= 100", within="10h")
    assert uhv.get("TMOT") == pytest.approx(100, abs=0.01)


def test_idle_is_the_end_of_the_last_move(rig, control, a):
    b = rig.logged_in("b")
    uhv = rig.serial()
    a.command(MOVE_F, 160)
    b.command(MOVE_F, 3_200)
    uhv.do("RUNR,100")
    control.run_until("idle")
    assert (a.flag(READY), b.flag(READY)) == (True, True)
    assert (a.position(), b.position(), uhv.get("PACT")) == (160, 3_200, 100)
    then = control.now()
    assert control.run_until("idle") == then, "nothing is left to happen"


def test_no_position_jumps_when_the_clock_is_changed(rig, control, a):
    uhv = rig.serial()
    uhv.ask("VMAX,50")
    uhv.do("RUNV,+")
    a.command(RUN_F, speed=100)
    control.step("3s")
    seen = [look(control, a, uhv)]
    for mode in ["real", "x10", "paused", "x100", "x0.01", "real", "paused", "real", "x5", "paused"]:
        control.clock(mode)
        for _ in range(5):
            seen.append(look(control, a, uhv))
    for (before, earlier, *_), (_, _, place, turned, after) in zip(seen, seen[1:]):
        most = (after - before) / SECOND_NS + 0.001
        assert 0 <= place - earlier[0] <= STEPS_PER_SECOND * MICRO * most + 1
        assert 0 <= turned - earlier[1] <= 50 * most + 1
    assert seen[-1][2] > seen[0][2]


def look(control, a, uhv) -> tuple:
    """The rig time before, both positions, and the rig time after."""
    before = control.now()
    place, turned = a.position(), uhv.get("PACT")
    return (before, (place, turned), place, turned, control.now())


def test_clients_stay_connected_through_all_that_the_clock_does(rig, control, a):
    b, over_tcp, over_pty = rig.logged_in("b"), rig.serial("tcp"), rig.serial("pty")
    for number, mode in enumerate(["real", "x1000000", "x0.01", "paused", "x100", "real"], 1):
        control.clock(mode)
        control.step("1h")
        control.clock(mode)
        a.write(TARGET_SPEED, 100 + number)
        assert b.flag(ACCESS) is True
        assert a.holding(TARGET_SPEED, 1) == [100 + number]
        assert over_tcp.ask(f"BAKET,{number}").data == str(number)
        assert over_pty.ask("BAKET").data == str(number)
    assert control.clock("paused") >= 6 * 3600 * SECOND_NS


def test_clients_are_answered_while_rig_time_is_moved_on(rig, control, a):
    stop = threading.Event()
    places = []

    def poll():
        while not stop.is_set():
            places.append(a.position())

    b = rig.logged_in("b")
    control.clock("x100")
    b.store_program(0, [instruction(GO_TO, 160), instruction(GO_TO, 0), instruction(0x29, 0)])
    b.command(0x2F)
    control.clock("paused")
    a.command(RUN_F, speed=15)
    poller = threading.Thread(target=poll)
    poller.start()
    try:
        control.step("8h")
        answered = len(places)
    finally:
        stop.set()
        poller.join()
    assert b.flag(PROGRAM_RUN) is True
    assert answered > 3
    assert a.speed() == 15
