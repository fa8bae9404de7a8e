"""What can go wrong with an SMSD and its line, and its signals, seen by pymodbus. The rig's clock is paused."""

import time

import pytest
from pymodbus.exceptions import ConnectionException, ModbusException, ModbusIOException

from control import be_impatient, running
from controller import *
from test_programs import build

DEVICE_FAILURE = 4
SOON = 0.1
TRIES = 20
# How pymodbus says that a connection is gone.
GONE = (ConnectionException, ConnectionError)


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


def steps(microsteps: int) -> float:
    return microsteps / MICRO


def speed_limit(client) -> int:
    return client.holding(MAX_SPEED, 1)[0]


def store(control, client, text: str, memory: int = 0):
    """Stores a program, with the clock going meanwhile: the memory takes its time."""
    control.clock("x100")
    client.store_program(memory, build(f".mem {memory}\n{text}", memory))
    control.clock("paused")


# Switches


def test_a_switch_that_is_stuck_open_is_driven_past(control, a):
    control.do("fault a.IN1 stuck-open")
    a.write(TARGET_INPUT, 1)
    a.command(GO_UNTIL_F)
    control.run_until("a.carriage >= 500")
    assert a.flag(READY) is False
    assert a.input(INPUTS, 1) == [0]
    a.command(CMD_HARD_STOP)
    control.do("fault a.IN1 off")
    a.command(GO_UNTIL_R)
    control.run_until("a.READY")
    assert 290 < steps(a.position()) < 320, "on its way back it brakes from where the switch closes"


def test_a_switch_that_is_stuck_closed_lets_no_search_begin(control, a):
    control.do("fault a.IN1 stuck-closed")
    assert a.input(INPUTS, 1) == [0b10]
    a.command(SCAN_MARK_F, speed=1000)
    assert a.flag(READY) is True
    control.step("1s")
    assert a.position() == 0
    control.do("fault a.IN1 off")
    a.command(SCAN_MARK_F, speed=1000)
    control.run_until("a.READY")
    assert a.position() == 300 * MICRO


def test_a_switch_that_bounces_closes_and_opens_several_times(control, a):
    a.command(MOVE_F, 100_000)
    assert edges(control) == 2, "in order it closes and opens"
    a.command(CMD_HARD_STOP)
    control.do("fault a.IN1 bounce")
    a.command(GO_TO, 0)
    assert edges(control) >= 6


def edges(control) -> int:
    """How often IN1 changes until the motor is well past its switch."""
    edges = 0
    while control.comes_about("not a.IN1" if edges % 2 else "a.IN1", "100ms" if edges else "1s"):
        edges += 1
    return edges


def test_a_contact_that_bounces_tells_of_a_closing_when_it_opens(control, a):
    def leaves_the_switch() -> bool:
        a.command(GO_TO, 105 * MICRO)
        control.run_until("a.READY")
        control.step("10ms")
        a.write_coil(CLR, True)
        assert a.flag(SW_F) is True
        a.command(GO_TO, 200 * MICRO)
        control.run_until("a.READY")
        return a.flag(SW_EVN)

    assert leaves_the_switch() is False
    control.do("fault a.SW bounce")
    assert leaves_the_switch() is True
    control.do("fault a.SW off")
    assert leaves_the_switch() is False


# The motor


def test_a_blocked_rotor_loses_the_steps_that_are_counted(control, a):
    control.do("fault a.rotor blocked")
    a.command(MOVE_F, 200 * MICRO)
    control.run_until("a.ABS_POS >= 1600")
    assert control.drive("a")["stalled"] is True
    control.run_until("a.READY")
    assert a.position() == 200 * MICRO
    assert control.carriage("a") == 0
    control.do("fault a.rotor off")
    a.command(MOVE_F, 50 * MICRO)
    control.run_until("a.READY")
    assert a.position() == 250 * MICRO
    assert control.carriage("a") == 50


@pytest.mark.parametrize("fault", ["motor short", "temperature high"])
def test_a_motor_chip_that_protects_itself_is_in_hiz_until_it_is_cleared(control, a, fault):
    a.command(MOVE_F, 200 * MICRO)
    control.run_until("a.ABS_POS >= 1600")
    name = fault.split()[0]
    control.do(f"fault a.{fault} for 1s")
    assert control.faults("a") == {name: fault.split()[1]}
    assert (a.flag(HIZ), a.flag(STOP), a.flag(READY), a.position()) == (True, True, True, 1600)
    for _ in range(2):
        a.write(CMD, MOVE_F)
        assert a.flag(HIZ) is True
        control.step("2s")
        assert a.position() == 1600
    assert control.faults("a") == {}
    a.write_coil(CLR, True)
    a.command(MOVE_F, 100 * MICRO)
    control.run_until("a.READY")
    assert (a.flag(HIZ), a.position()) == (False, 1600 + 100 * MICRO)


# The supply and the front panel


def test_power_off_ends_connections_and_what_is_volatile(rig, control, a):
    a.write(MAX_SPEED, 2000)
    a.write_coil(RELAY, True)
    store(control, a, "SET_WAIT 1s\n")
    a.command(MOVE_F, 200 * MICRO)
    control.run_until("a.READY")
    control.do("power a off")
    assert a.is_closed_by_controller()
    assert control.drive("a")["state"] == "OFF"
    with pytest.raises(GONE):
        rig.modbus("a").input(HW_MAJOR, 1)
    b = rig.logged_in("b")
    control.do("power a on")
    again = rig.modbus("a")
    assert again.flag(ACCESS) is False
    again.log_in()
    assert (again.position(), again.flag(HIZ), again.coils(RELAY, 1)) == (0, True, [False])
    assert speed_limit(again) == 1000
    control.clock("x100")
    assert again.program_size(0) == 1
    assert control.carriage("a") == 200, "the carriage stays where it was"
    assert b.flag(ACCESS) is True, "the other drive has seen nothing of it"


def test_power_comes_back_by_itself(rig, control, a):
    control.do("power a off for 2s")
    assert a.is_closed_by_controller()
    control.step("1999999999ns")
    assert control.drive("a")["powered"] is False
    control.step("1ns")
    assert rig.logged_in("a").position() == 0


def test_the_front_panel_says_what_runs_after_the_next_power_up(rig, control, a):
    store(control, a, "SET_ACC 20000\nSET_DEC 20000\nMOVE_F 320\n", memory=2)
    control.do("panel a bF 2")
    assert a.flag(PROGRAM_RUN) is False
    control.do("power a off")
    assert a.is_closed_by_controller()
    control.do("power a on")
    a = rig.modbus("a")
    a.log_in()
    assert a.flag(PROGRAM_RUN) is True
    assert a.input(MODE_N_PROGRAMS, 1) == [2]
    control.run_until("not a.PROGRAM_RUN")
    assert a.position() == 320
    control.do("panel a LA", "power a off")
    assert a.is_closed_by_controller()
    control.do("power a on")
    a = rig.modbus("a")
    a.log_in()
    assert a.flag(PROGRAM_RUN) is False


# The line


def test_a_cut_connection_closes_and_no_new_one_is_taken(rig, control, a):
    a.command(MOVE_F, 200 * MICRO)
    control.do("fault a.connection cut")
    assert a.is_closed_by_controller()
    with pytest.raises(GONE):
        rig.modbus("a").input(HW_MAJOR, 1)
    control.step("1s")
    control.do("fault a.connection off")
    again = rig.logged_in("a")
    assert again.position() == 200 * MICRO, "the drive went on"


def test_a_silent_line_answers_nothing_and_carries_out_nothing(control, a):
    control.do("fault a.connection silent")
    be_impatient(a, SOON)
    with pytest.raises(ModbusIOException, match="No response"):
        a.write(MAX_SPEED, 2000)
    control.do("fault a.connection off")
    assert speed_limit(a) == 1000, "the connection is the same, and still logged in"


def test_a_reply_that_is_late_comes_in_time_for_a_patient_client(control, a):
    control.do("fault a.reply-delay 300ms 50ms")
    for _ in range(2):
        asked = time.monotonic()
        assert speed_limit(a) == 1000
        assert 0.25 <= time.monotonic() - asked < 0.6


def test_a_reply_that_is_late_is_too_late_for_an_impatient_client(control, a):
    control.do("fault a.reply-delay 300ms 50ms")
    be_impatient(a, SOON)
    with pytest.raises(ModbusIOException, match="No response"):
        a.write(MAX_SPEED, 2000)
    control.do("fault a.reply-delay off")
    be_impatient(a, 2)
    assert speed_limit(a) == 2000, "it was carried out, and its late reply is not taken for another"


def test_a_request_whose_reply_is_dropped_is_carried_out(control, a):
    control.do("fault a.reply-drop on")
    be_impatient(a, SOON)
    with pytest.raises(ModbusIOException, match="No response"):
        a.write(MAX_SPEED, 2000)
    control.do("fault a.reply-drop off")
    assert speed_limit(a) == 2000


def test_dropped_replies_now_and_then_are_asked_for_again(control, a):
    control.do("fault a.reply-drop 50%")
    be_impatient(a, 0.02)
    a.client.transaction.retries = TRIES
    assert [speed_limit(a) for _ in range(TRIES)] == [1000] * TRIES


def test_replies_in_pieces_are_put_together(control, a):
    control.do("fault a.reply-pieces 64 2ms")
    asked = time.monotonic()
    assert a.holding(MIN_SPEED, 5) == [0, 1000, 20_000, 20_000, 15_600]
    assert time.monotonic() - asked > 18 * 0.002, "19 bytes, byte by byte"
    control.do("fault a.reply-pieces 2")
    assert [speed_limit(a) for _ in range(TRIES)] == [1000] * TRIES


@pytest.mark.parametrize("fault", ["reply-damage", "reply-duplicate"])
def test_bytes_that_are_wrong_disturb_no_more_than_their_reply(rig, control, a, fault):
    control.do(f"fault a.{fault} on")
    be_impatient(a, 0.03)
    troubled = [number for number in range(TRIES) if reads_badly(a)]
    assert troubled, "nothing was wrong"
    b = rig.logged_in("b")
    assert speed_limit(b) == 1000
    control.do(f"fault a.{fault} off")
    again = rig.logged_in("a")
    assert [speed_limit(again) for _ in range(TRIES)] == [1000] * TRIES


def reads_badly(client) -> bool:
    """Whether pymodbus complains, or has read something else than is there."""
    try:
        answer = client.client.read_holding_registers(MIN_SPEED, count=5, device_id=1)
    except ModbusException:
        return True
    return answer.isError() or answer.registers != [0, 1000, 20_000, 20_000, 15_600]


def test_a_reply_with_another_transaction_is_not_taken(control, a):
    control.do("fault a.reply-id on")
    be_impatient(a, SOON)
    with pytest.raises(ModbusIOException, match="No response"):
        a.write(MAX_SPEED, 2000)
    control.do("fault a.reply-id off")
    assert speed_limit(a) == 2000


@pytest.mark.parametrize(("setting", "code"), [("04", DEVICE_FAILURE), ("06", BUSY)])
def test_exceptions_for_a_while(control, a, setting, code):
    control.do(f"fault a.exception {setting} for 1s")
    for _ in range(3):
        assert refusal(a.write, MAX_SPEED, 2000) == code
        assert refusal(a.flag, ACCESS) == code
    control.step("999999999ns")
    assert refusal(a.holding, MAX_SPEED, 1) == code
    control.step("1ns")
    assert speed_limit(a) == 1000, "nothing of it was carried out"


def test_what_goes_wrong_now_and_then_does_so_again_in_the_same_way(rig, control):
    def refused() -> list[bool]:
        client = rig.logged_in("a")
        control.do("fault a.exception 06 50%")
        fates = [is_refused(client) for _ in range(80)]
        control.do("fault a.exception off")
        return fates

    first = refused()
    assert 20 < sum(first) < 60
    assert refused() != first, "another connection is another sequence"
    rig.restart()
    control = rig.control
    assert refused() == first


def is_refused(client) -> bool:
    try:
        client.holding(MAX_SPEED, 1)
    except Refused as refused:
        assert refused.code == BUSY
        return True
    return False


# Signals and wires


def test_forced_inputs_and_pulses(control, a):
    control.do("input a.IN0 1", "input a.IN1 0")
    assert a.input(INPUTS, 1) == [0b01]
    assert control.drive("a")["inputs"]["IN0"] == {"level": True, "forced": True}
    a.write(TARGET_INPUT, 1)
    a.command(GO_UNTIL_F)
    control.run_until("a.carriage >= 310")
    assert a.flag(READY) is False, "its switch is closed, but the input is forced"
    control.do("input a.IN1 pulse 5ms")
    assert a.input(INPUTS, 1) == [0b11]
    control.run_until("a.READY")
    control.do("input a.IN0 release")
    assert a.input(INPUTS, 1) == [0]
    control.do("input a.IN0 1 for 1s")
    assert a.input(INPUTS, 1) == [1]
    control.step("1s")
    assert a.input(INPUTS, 1) == [0]


def test_a_program_goes_on_with_each_pulse(control, a):
    store(control, a, "again:\nWAIT_IN0\nMOVE_F 16\nSET_WAIT 20ms\nGOTO_PROGRAM again\n")
    a.command(0x2F)
    control.do("input a.IN0 pulse 5ms x10 every 100ms")
    control.step("2s")
    assert a.position() == 10 * 16


def test_a_wire_carries_the_relay_to_another_drive_until_it_is_cut(rig, control, a):
    b = rig.logged_in("b")
    store(control, b, "again:\nWAIT_CONTINUE\nMOVE_F 16\nSET_WAIT 10ms\nGOTO_PROGRAM again\n")
    b.command(0x2F)
    assert pulse_relay(control, a) and b.position() == 16
    control.do("wire a.relay b.CONTINUE cut")
    assert not pulse_relay(control, a) and b.position() == 16
    control.do("wire a.relay b.CONTINUE mend")
    assert pulse_relay(control, a) and b.position() == 32
    a.write_coil(RELAY, True)
    before = control.now()
    assert control.run_until("b.CONTINUE") - before == 5_000_000, "the wire's delay"


def pulse_relay(control, a) -> bool:
    """Switches the relay on for 10 ms; returns whether that came through the wire."""
    a.write_coil(RELAY, True)
    control.step("10ms")
    came = control.drive("b")["inputs"]["CONTINUE"]["level"]
    a.write_coil(RELAY, False)
    control.step("1s")
    return came
