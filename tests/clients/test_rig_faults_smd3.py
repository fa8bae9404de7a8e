"""What can go wrong with an SMD3 and its line, and its signals, seen by pyserial. The rig's clock is paused."""

import time

import pytest

from control import running
from smd3 import *

# Status flags
JSCON, EXTEN = 0x01, 0x08
# Error flags
TSHORT, TOPEN, TOVR, MOTOR_SHORT, EXTERNAL_DISABLE = 0x01, 0x02, 0x04, 0x08, 0x10

DISABLED = "-7 (Not possible when motor disabled)"
FAILED = "-5 (Action failed)"
SERIAL_NUMBER = "0x0040,0x0000,20168-001"
SOON = 0.1
TRIES = 10


@pytest.fixture
def rig(tmp_path):
    with running(tmp_path) as rig:
        yield rig


@pytest.fixture
def control(rig):
    return rig.control


@pytest.fixture
def uhv(rig):
    return rig.serial("pty")


@pytest.fixture(params=["pty", "tcp"])
def line(request, rig):
    """A connection over each of the ways there are."""
    return rig.serial(request.param)


def configure(uhv):
    """Settings that make moves short, and limits that count."""
    for setting in ["AMAX,16000", "DMAX,16000", "VSTOP,200", "VSTART,200", "VMAX,800", "L,1"]:
        assert uhv.ask(setting).data


def is_unanswered(line, command: str) -> bool:
    """Whether no byte comes soon."""
    line.port.timeout = SOON
    line.port.write(command.encode("ascii") + b"\r\n")
    answer = line.port.read(1)
    line.port.timeout = 5
    return answer == b""


# Faults of the motor and its sensor


@pytest.mark.parametrize(("fault", "sensor", "flag"), [("open", 0, TOPEN), ("open", 1, TOPEN), ("short", 1, TSHORT)])
def test_a_sensor_that_fails_disables_the_motor(control, uhv, fault, sensor, flag):
    uhv.ask(f"TSEL,{sensor}")
    uhv.do("RUNV,+")
    control.do(f"fault uhv.thermocouple {fault}")
    assert uhv.do("").eflags == flag
    assert uhv.get("VACT") == 0
    assert uhv.ask("RUNV,+").data == DISABLED
    assert uhv.do("CLR").eflags == flag, "its cause is still there"
    control.do("fault uhv.thermocouple off")
    assert uhv.do("").eflags == flag, "it stays until it is cleared"
    assert uhv.do("CLR").eflags == 0
    uhv.do("RUNV,+")
    control.step("1s")
    assert uhv.get("VACT") > 0


def test_a_short_circuited_thermocouple_shows_the_ambient_temperature(control, uhv):
    uhv.ask("MODE,4")
    uhv.do("RUNB")
    control.step("1h")
    assert uhv.get("TMOT") > 100
    control.do("fault uhv.thermocouple short")
    reply = uhv.ask("TMOT")
    assert (float(reply.data), reply.eflags) == (20, 0)


def test_too_much_heat_disables_the_motor_until_it_has_cooled(control, uhv):
    uhv.do("RUNV,+")
    control.do("fault uhv.temperature high")
    reply = uhv.ask("TMOT")
    assert (float(reply.data), reply.eflags) == (200, TOVR)
    assert uhv.ask("RUNR,100").data == DISABLED
    control.do("fault uhv.temperature off")
    assert uhv.do("CLR").eflags == TOVR, "it is still hot"
    control.run_until("uhv.TMOT < 60", within="1h")
    assert uhv.do("CLR").eflags == 0
    uhv.do("RUNR,100")


def test_a_short_circuit_shows_while_a_current_flows(control, uhv):
    uhv.do("RUNV,+")
    control.do("fault uhv.motor short for 1s")
    assert uhv.do("").eflags == MOTOR_SHORT
    assert uhv.ask("RUNV,+").data == DISABLED
    control.step("1s")
    assert uhv.do("CLR").eflags == 0
    uhv.do("RUNV,+")


# Flash


def restart_drive(control):
    control.do("power uhv off")
    control.step("1s")
    control.do("power uhv on")


def test_a_worn_flash_keeps_what_it_had(control, uhv):
    uhv.ask("BAKET,77")
    uhv.do("STORE")
    control.do("fault uhv.flash worn")
    uhv.ask("BAKET,99")
    assert uhv.ask("STORE").data == FAILED
    assert uhv.ask("BAKET").data == "99"
    restart_drive(control)
    assert uhv.ask("BAKET").text == "0x0040,0x0000,77"
    control.do("fault uhv.flash off")
    uhv.ask("BAKET,99")
    uhv.do("STORE")
    restart_drive(control)
    assert uhv.ask("BAKET").data == "99"


def test_a_damaged_flash_gives_the_factory_settings_at_power_up(control, uhv):
    uhv.ask("BAKET,77")
    uhv.do("STORE")
    control.do("fault uhv.flash damaged")
    assert uhv.ask("LOAD").data == FAILED
    assert uhv.ask("BAKET").data == "77"
    restart_drive(control)
    reply = uhv.ask("BAKET")
    assert (reply.data, reply.eflags) == ("150", CONFIGURATION_ERROR)
    assert uhv.do("CLR").eflags == 0
    uhv.ask("BAKET,88")
    uhv.do("STORE")
    assert control.faults("uhv") == {}, "what is stored anew is whole"
    restart_drive(control)
    assert uhv.ask("BAKET").text == "0x0040,0x0000,88"


def test_what_was_stored_reads_well_again_when_the_damage_is_gone(control, uhv):
    uhv.ask("BAKET,77")
    uhv.do("STORE")
    control.do("fault uhv.flash damaged")
    restart_drive(control)
    control.do("fault uhv.flash off")
    uhv.do("CLR")
    assert uhv.ask("BAKET").data == "150"
    uhv.do("LOAD")
    assert uhv.ask("BAKET").text == "0x0040,0x0000,77"


# Limits, and the rotor


def test_a_limit_switch_that_is_stuck_open_does_not_stop_the_motor(control, uhv):
    configure(uhv)
    control.do("fault uhv.LIMIT_POSITIVE stuck-open")
    uhv.do("RUNV,+")
    control.run_until("uhv.PACT >= 1200")
    reply = uhv.ask("PACT")
    assert (float(reply.data), reply.sflags & (LIMIT_POSITIVE | STANDBY)) == (1200, 0)
    drive = control.drive("uhv")
    assert (drive["carriage"], drive["stalled"]) == (1000, True), "at the hard end the steps are lost"
    control.do("fault uhv.LIMIT_POSITIVE off")
    assert uhv.do("").has(LIMIT_POSITIVE | STANDBY), "it counts at once"
    assert uhv.get("VACT") == 0


def test_a_limit_switch_that_is_stuck_closed_lets_nothing_move_towards_it(control, uhv):
    configure(uhv)
    control.do("fault uhv.LIMIT_POSITIVE stuck-closed")
    assert uhv.do("").has(LIMIT_POSITIVE)
    uhv.do("RUNV,+")
    control.step("1s")
    assert uhv.get("PACT") == 0
    uhv.do("RUNR,-50")
    control.run_until("uhv.STANDBY")
    assert uhv.get("PACT") == -50


def test_homing_with_a_switch_that_is_stuck_open_never_ends(control, uhv):
    configure(uhv)
    uhv.ask("MODE,5")
    control.do("fault uhv.LIMIT_NEGATIVE stuck-open")
    uhv.do("RUNH,-")
    assert not control.comes_about("uhv.STANDBY", "10s")
    assert uhv.get("PACT") < -5000
    assert control.carriage("uhv") == -1000
    uhv.do("ESTOP")
    uhv.do("CLR")
    control.do("fault uhv.LIMIT_NEGATIVE off")
    uhv.do("RUNH,-")
    control.run_until("uhv.STANDBY")
    assert uhv.get("PACT") == 0
    assert control.carriage("uhv") == pytest.approx(-400, abs=0.1)


def test_homing_with_a_switch_that_is_stuck_closed_is_given_up_at_the_other_one(control, uhv):
    configure(uhv)
    uhv.ask("MODE,5")
    control.do("fault uhv.LIMIT_NEGATIVE stuck-closed")
    uhv.do("RUNH,-")
    control.run_until("uhv.STANDBY")
    reply = uhv.ask("PACT")
    assert float(reply.data) == 400, "nothing was taken as zero"
    assert reply.sflags == LIMIT_NEGATIVE | LIMIT_POSITIVE | STANDBY


def test_a_blocked_rotor_loses_the_steps_that_are_counted(control, uhv):
    configure(uhv)
    control.do("fault uhv.rotor blocked")
    uhv.do("RUNR,100")
    control.run_until("uhv.STANDBY")
    assert (uhv.get("PACT"), control.carriage("uhv")) == (100, 0)


# Signals


def test_a_joystick_takes_over_and_its_buttons_move_the_motor(control, uhv):
    configure(uhv)
    control.do("input uhv.JOYSTICK 1")
    assert uhv.do("").has(JSCON)
    assert uhv.ask("MODE").data == "3 (Joystick)"
    control.do("input uhv.JOYSTICK_CW pulse 100ms x3 every 1s")
    control.step("4s")
    assert uhv.get("PACT") == 3, "a brief press is a step"
    control.do("input uhv.JOYSTICK_CCW 1")
    control.step("800ms")
    assert uhv.get("VACT") == pytest.approx(-800, rel=0.001)
    control.do("input uhv.JOYSTICK_CCW release")
    control.run_until("uhv.STANDBY")
    assert uhv.get("PACT") < -100
    control.do("input uhv.JOYSTICK release")
    assert not uhv.do("").has(JSCON)
    assert uhv.ask("MODE").data == "2 (Remote)"


def test_a_joystick_that_is_pulled_out_stops_what_it_started(control, uhv):
    configure(uhv)
    control.do("input uhv.JOYSTICK 1", "input uhv.JOYSTICK_CW 1")
    control.step("700ms")
    assert uhv.get("VACT") > 0
    control.do("input uhv.JOYSTICK release")
    control.run_until("uhv.STANDBY")
    assert uhv.get("VACT") == 0
    assert uhv.ask("MODE").data == "2 (Remote)"


def test_the_enable_input_and_the_reset_fault_input(control, uhv):
    control.do("input uhv.ENABLE 1")
    uhv.ask("EXTEN,1")
    assert uhv.do("RUNV,+").has(EXTEN)
    control.do("input uhv.ENABLE 0")
    reply = uhv.do("")
    assert (reply.eflags, reply.has(EXTEN)) == (EXTERNAL_DISABLE, False)
    assert uhv.ask("RUNV,+").data == DISABLED
    control.do("input uhv.RESET_FAULT pulse 5ms")
    assert uhv.do("").eflags == EXTERNAL_DISABLE, "its cause is still there"
    control.step("10ms")
    control.do("input uhv.ENABLE 1")
    assert uhv.do("").eflags == EXTERNAL_DISABLE
    control.do("input uhv.RESET_FAULT pulse 5ms")
    assert uhv.do("").eflags == 0
    uhv.do("RUNV,+")


def test_step_pulses_are_steps_in_the_direction_of_dir(control, uhv):
    uhv.ask("INTERP,1")
    assert uhv.ask("MODE,0").data.startswith("0 ")
    control.do("input uhv.DIR 1", "input uhv.STEP pulse 1ms x200 every 5ms")
    control.run_until("idle")
    assert uhv.get("PACT") == 200
    control.do("input uhv.DIR 0", "input uhv.STEP pulse 1ms x50 every 5ms")
    control.run_until("idle")
    assert uhv.get("PACT") == 150
    uhv.ask("EDGE,1")
    control.do("input uhv.STEP pulse 2ms x50 every 5ms")
    control.run_until("idle")
    assert uhv.get("PACT") == 50, "both edges count"
    assert control.carriage("uhv") == 50


# The line


def test_a_silent_line_answers_nothing_and_carries_out_nothing(control, line):
    line.ask("BAKET,77")
    control.do("fault uhv.connection silent")
    assert is_unanswered(line, "BAKET,99")
    control.do("fault uhv.connection off")
    assert line.ask("BAKET").data == "77", "the connection is the same"


def test_a_cut_line_over_tcp_is_closed(rig, control):
    line = rig.serial("tcp")
    line.do("RUNV,+")
    control.do("fault uhv.connection cut")
    with pytest.raises(OSError):
        for _ in range(10):
            line.ask("STOP")
    control.step("1s")
    control.do("fault uhv.connection off")
    again = rig.serial("tcp")
    assert again.get("VACT") > 0, "the drive went on"


def test_a_cut_serial_port_is_dead_until_it_is_mended(rig, control):
    line = rig.serial("pty")
    control.do("fault uhv.connection cut")
    assert is_unanswered(line, "BAKET,99")
    assert is_unanswered(line, "BAKET,99")
    control.do("fault uhv.connection off")
    assert line.ask("BAKET").data == "150", "nothing of it was carried out"


def test_power_off_ends_connections_and_what_is_volatile(rig, control, uhv):
    over_tcp = rig.serial("tcp")
    uhv.ask("BAKET,77")
    control.do("power uhv off")
    with pytest.raises(OSError):
        for _ in range(10):
            over_tcp.ask("SER")
    assert is_unanswered(uhv, "SER")
    control.do("power uhv on")
    assert uhv.ask("SER").text == SERIAL_NUMBER, "the port itself was there all the time"
    assert uhv.ask("BAKET").data == "150"
    assert rig.serial("tcp").ask("SER").text == SERIAL_NUMBER


def test_a_reply_that_is_late(control, line):
    control.do("fault uhv.reply-delay 300ms 50ms")
    asked = time.monotonic()
    assert line.ask("BAKET,77").data == "77"
    assert 0.25 <= time.monotonic() - asked < 0.6
    assert is_unanswered(line, "BAKET,99")
    assert line.port.read_until(b"\r\n") == b"0x0040,0x0000,99\r\n", "late, but it comes"


def test_a_command_whose_reply_is_dropped_is_carried_out(control, line):
    control.do("fault uhv.reply-drop on")
    assert is_unanswered(line, "BAKET,77")
    control.do("fault uhv.reply-drop off")
    assert line.ask("BAKET").data == "77"


def test_replies_in_pieces_are_put_together(control, line):
    control.do("fault uhv.reply-pieces 64 2ms")
    asked = time.monotonic()
    assert line.ask("SER").text == SERIAL_NUMBER
    assert time.monotonic() - asked > (len(SERIAL_NUMBER) + 1) * 0.002


@pytest.mark.parametrize(("fault", "more"), [("reply-damage", 0), ("reply-duplicate", 1)])
def test_bytes_that_are_wrong_disturb_no_more_than_their_reply(control, line, fault, more):
    in_order = SERIAL_NUMBER.encode("ascii") + b"\r\n"
    control.do(f"fault uhv.{fault} on")
    for _ in range(TRIES):
        line.port.write(b"SER\r\n")
        came = line.port.read(len(in_order) + more)
        assert len(came) == len(in_order) + more and came != in_order
        line.port.timeout = SOON / 10
        line.port.read(len(in_order))
        line.port.timeout = 5
    control.do(f"fault uhv.{fault} off")
    assert [line.ask("SER").text for _ in range(TRIES)] == [SERIAL_NUMBER] * TRIES
