"""Every instruction of an SMSD as a packet of its own, its ranges, and the counters of errors. The rig's clock is paused."""

import time

import pytest

import controller as modbus
from smsd_usb import *

# Data in range, of instructions that take some.
DATA = {
    SET_MODE: 10813, SET_MAX_SPEED: 1000, SET_ACC: 2000, SET_DEC: 2000, SET_FS_SPEED: 15600, SET_MASK_EVENT: 0xFF,
    **dict.fromkeys([RUN_F, RUN_R, SCAN_ZERO_F, SCAN_ZERO_R, SCAN_LABEL_F, SCAN_LABEL_R, SCAN_MARK2_F, SCAN_MARK2_R], 100),
    MOVE_F: 10, MOVE_R: -10, GO_TO_F: 100, GO_TO_R: -100, GO_TO: 5, SET_WAIT: 1000, SET_WAIT_2: 1000, LOOP_PROGRAM: 5125,
}

# Least and greatest data, of instructions that take a number.
RANGES = {
    SET_MIN_SPEED: (0, 950), SET_MAX_SPEED: (16, 15600), SET_ACC: (15, 59000), SET_DEC: (15, 59000), SET_FS_SPEED: (15, 15600),
    SET_MASK_EVENT: (0, 255), RUN_F: (15, 15600), RUN_R: (15, 15600), GO_UNTIL_F: (0, 7), GO_UNTIL_R: (0, 7),
    SCAN_ZERO_F: (15, 15600), SCAN_ZERO_R: (15, 15600), SCAN_LABEL_F: (15, 15600), SCAN_LABEL_R: (15, 15600),
    SCAN_MARK2_F: (15, 15600), SCAN_MARK2_R: (15, 15600), SET_WAIT: (0, 3_600_000), SET_WAIT_2: (0, 3_600_000),
}

GREATEST_DATA = (1 << 22) - 1


@pytest.fixture
def rig(tmp_path):
    with UsbRig(tmp_path) as rig:
        yield rig


@pytest.fixture
def usb(rig):
    return rig.logged_in()


def calm(usb):
    """No program, no motion, no error."""
    usb.do(STOP_PROGRAM_MEM)
    usb.do(HARD_HI_Z)
    usb.do(GET_STATUS_AND_CLR)


@pytest.mark.parametrize("transport", ["usb", "usb_tcp"])
def test_every_instruction_is_answered_with_its_code(rig, transport):
    usb = rig.logged_in(transport)
    for code in range(SCAN_MARK2_R + 1):
        if code in (STOP_USB, RETURN_PROGRAM):
            continue
        calm(usb)
        usb.do(code, DATA.get(code, 0))
    calm(usb)
    assert usb.refusal(RETURN_PROGRAM) == ERROR_PROGRAMS, "nothing was called"
    assert usb.refusal(0x3F) == ERROR_NO_COMMAND
    assert not usb.status() & CMD_ERROR


def test_values_come_with_the_instruction_that_asks_for_them_alone(rig, usb):
    usb.do(MOVE_F, -777)
    rig.run()
    usb.do(HARD_HI_Z)
    values = {
        GET_ABS_POS: -777 & 0xFFFFFFFF, GET_MAX_SPEED: 1000, STATUS_IN_EVENT: 0xFF00, GET_MODE: 0x22A01,
        # The last program that was started.
        GET_STACK: 3 << 8,
    }
    for code in range(SCAN_MARK2_R + 1):
        if code in (STOP_USB, RETURN_PROGRAM, GET_EL_POS, RESET_POS, RESET_POWERSTEP01):
            continue
        calm(usb)
        if code in values:
            # Data that nobody asked for is ignored.
            assert usb.do(code, GREATEST_DATA) == values[code], f"{code:02X}"
        else:
            data = GREATEST_DATA if code not in DATA and code not in RANGES else DATA.get(code, 0)
            assert usb.do(code, data) == 0, f"{code:02X}"
        calm(usb)
        if usb.position() != -777:
            usb.do(GO_TO, -777)
            rig.run()
        for setting in (SET_MASK_EVENT, SET_MAX_SPEED):
            usb.do(setting, DATA[setting])
        usb.do(HARD_HI_Z)
        usb.do(SET_MODE, 0x22A01)


def test_numbers_out_of_range_are_refused_and_change_nothing(usb):
    usb.do(SET_MODE, 10813)
    before = usb.state()
    for code, (least, greatest) in RANGES.items():
        beyond = [greatest + 1, GREATEST_DATA] + ([least - 1, 0] if least > 0 else [])
        for data in beyond:
            assert usb.refusal(code, data) == ERROR_RANGE, f"{code:02X} {data}"
        assert usb.state() == before, f"{code:02X}"
    assert "COMMAND_POWERSTEP01" not in usb.counters()
    for code, ends in RANGES.items():
        for data in ends:
            calm(usb)
            usb.do(code, data)


def test_reserved_bits_are_refused(usb):
    before = usb.state()
    for bit in range(4):
        for code in (GET_ABS_POS, SET_RELE, RUN_F):
            line = word(code, 100) | 1 << bit
            assert usb.code(POWERSTEP01, line.to_bytes(4, "little")) == ERROR_RANGE, f"{line:08X}"
    assert usb.state() == before


@pytest.mark.parametrize(("model", "greatest_motor", "greatest_current"), [("SMSD-4.2LAN", 45, 42), ("SMSD-8.0LAN", 54, 80)])
def test_a_motor_configuration_is_that_of_the_model(tmp_path, model, greatest_motor, greatest_current):
    def mode(motor=1, current=10, microstepping=3):
        return 1 | motor << 1 | microstepping << 7 | current << 10 | 2 << 17

    with UsbRig(tmp_path, model) as rig:
        usb = rig.logged_in()
        for data in [mode(), mode(motor=greatest_motor), mode(current=greatest_current), mode(current=1), mode(microstepping=7)]:
            # The bits above are the number of a program, which is read only.
            usb.do(SET_MODE, data | 3 << 19)
            assert usb.do(GET_MODE) == data
        for wrong in [mode(motor=greatest_motor + 1), mode(motor=63), mode(current=0), mode(current=greatest_current + 1)]:
            assert usb.refusal(SET_MODE, wrong) == ERROR_RANGE, wrong
            assert usb.do(GET_MODE) == data
        rig.control.do("panel stage LA 2", "power stage off", "power stage on")
        rig.pass_time("1s")
        assert usb.try_password(PASSWORD) == OK_ACCESS
        assert usb.do(GET_MODE) == data | 2 << 19


def test_what_the_motor_chip_refuses_raises_cmd_error_until_it_is_cleared(rig, usb):
    usb.do(RUN_F, 1000)
    refused = [MOVE_F, MOVE_R, GO_TO, SET_MIN_SPEED, SET_ACC, SET_DEC, SET_MODE]
    for number, code in enumerate(refused, 1):
        answer = usb.give(code, DATA.get(code, 0))
        assert answer.code == OK and answer.status & CMD_ERROR, f"{code:02X}"
        assert usb.status() & CMD_ERROR, "it stays"
        assert usb.counters()["COMMAND_POWERSTEP01"] == number
        cleared = usb.give(GET_STATUS_AND_CLR)
        assert cleared.code == OK and cleared.status & CMD_ERROR, "the status before"
        assert not usb.status() & CMD_ERROR
    usb.do(SET_MAX_SPEED, 200)
    usb.do(HARD_HI_Z)


def test_instructions_of_programs_do_nothing_outside_of_one(rig, usb):
    for code in [END, SET_WAIT, SET_WAIT_2, WAIT_IN0, WAIT_IN1, WAIT_CONTINUE, GOTO_PROGRAM, GOTO_PROGRAM_IF_IN0,
                 GOTO_PROGRAM_IF_IN1, GOTO_PROGRAM_IF_ZERO, GOTO_PROGRAM_IF_IN_ZERO, LOOP_PROGRAM, CALL_PROGRAM]:
        before = usb.state()
        usb.do(code, DATA.get(code, 0))
        assert usb.state() == before, f"{code:02X}"
    assert usb.write_memory(0, [word(WAIT_IN0), word(SET_RELE)]) == OK
    usb.do(START_PROGRAM_MEM0)
    rig.pass_time("10ms")
    before = usb.state()
    for code in [END, SET_WAIT, WAIT_IN1, GOTO_PROGRAM, LOOP_PROGRAM, CALL_PROGRAM]:
        usb.do(code)
    assert usb.refusal(RETURN_PROGRAM) == ERROR_PROGRAMS
    assert usb.state() == before
    rig.control.do("input stage.IN0 1")
    rig.run("not stage.PROGRAM_RUN")
    assert usb.relay_is_on()


def test_the_relay_and_the_relays_state(rig, usb):
    lan = rig.modbus_logged_in()
    for code, on in [(SET_RELE, True), (SET_RELE, True), (CLR_RELE, False), (SET_RELE, True)]:
        usb.do(code)
        answer = usb.give(GET_RELE)
        assert (answer.kind, answer.code) == (POWERSTEP01, STATUS_RELE_SET if on else STATUS_RELE_CLR)
        assert lan.coils(modbus.RELAY, 1) == [on]


def test_step_clock_hands_the_motor_to_its_inputs(rig, usb):
    usb.do(STEP_CLOCK)
    rig.control.do("input stage.EN 1", "input stage.DIR 1")
    rig.control.do("input stage.STEP pulse 10us x100 every 1ms")
    rig.pass_time("1s")
    # As the SMSD's own inputs move it, whichever level of DIR is which way.
    assert abs(usb.position()) == 100
    usb.do(GO_TO, 0)
    rig.run()
    assert usb.position() == 0


def test_stop_usb_ends_the_session_of_the_port_until_it_is_opened_again(rig, usb):
    usb.do(RUN_F, 100)
    other = rig.logged_in("usb_tcp")
    usb.do(STOP_USB)
    for silent in (packet(VERSION_GET), packet(REQUEST, PASSWORD), packet(99)):
        usb.line.send(silent)
        assert usb.line.is_silent()
    assert other.status() & MOT_STATUS, "neither the motor nor another session stops"
    rig.close(usb)
    rig.logged_in().do(HARD_HI_Z)


def test_a_controller_of_version_1_has_no_newer_instructions(tmp_path):
    with UsbRig(tmp_path, ports=USB_AND_MODBUS + "protocol_version = 1\n") as rig:
        usb = rig.logged_in()
        assert usb.versions()[-1] == 1
        for code in range(END, STOP_USB):
            if code != RETURN_PROGRAM:
                calm(usb)
                usb.do(code, DATA.get(code, 0))
        calm(usb)
        before = usb.state()
        for code in NEWER:
            assert usb.refusal(code, DATA.get(code, 0)) == ERROR_NO_COMMAND, f"{code:02X}"
            assert usb.write_memory(1, [word(SET_RELE), word(code, DATA.get(code, 0))]) == ERROR_NO_COMMAND
        assert usb.state() == before
        usb.version = 2
        usb.line.send(packet(POWERSTEP01, word(GET_ABS_POS).to_bytes(4, "little"), version=2))
        assert Packet.parse(usb.line.receive()).version == 1, "what the request says is not looked at"


# Counters


def test_counters_begin_at_zero_with_the_power(rig, usb):
    assert usb.counters() == {}
    usb.do(RUN_F, 100)
    assert usb.counters() == {"N_STARTS": 1}
    rig.control.do("power stage off", "power stage on")
    rig.pass_time("1s")
    assert usb.try_password(PASSWORD) == OK_ACCESS
    assert usb.counters() == {}


def test_each_energising_of_the_phases_is_counted(rig, usb):
    for _ in range(3):
        usb.do(MOVE_F, 16)
        rig.run()
        usb.do(MOVE_R, 16)
        rig.run()
        usb.do(SOFT_HI_Z)
        rig.run()
    usb.do(HARD_STOP)
    assert usb.counters() == {"N_STARTS": 4}
    assert usb.write_memory(0, [word(HARD_HI_Z), word(MOVE_F, 1), word(HARD_HI_Z), word(HARD_STOP), word(END)]) == OK
    usb.do(START_PROGRAM_MEM0)
    rig.run("not stage.PROGRAM_RUN")
    assert usb.counters() == {"N_STARTS": 6}


def test_a_program_that_fails_is_counted(rig, usb):
    for number, program in enumerate([[word(RETURN_PROGRAM)], [word(CALL_PROGRAM)], [word(GET_SPEED)]], 1):
        usb.give(GET_STATUS_AND_CLR)
        assert usb.write_memory(0, program) == OK
        usb.do(START_PROGRAM_MEM0)
        rig.run("not stage.PROGRAM_RUN")
        assert usb.counters()["WORK_PROGRAM"] == number
    usb.give(GET_STATUS_AND_CLR)
    assert usb.write_memory(0, [word(SET_RELE)]) == OK
    usb.do(START_PROGRAM_MEM0)
    rig.run("not stage.PROGRAM_RUN")
    assert usb.counters()["WORK_PROGRAM"] == number, "this one ends well"


def test_overheating_and_stalling_are_counted(rig, usb):
    usb.do(RUN_F, 200)
    rig.pass_time("1s")
    rig.control.do("fault stage.rotor blocked")
    rig.pass_time("1s")
    assert usb.counters()["STALL_POWERSTEP01"] == 1
    rig.control.do("fault stage.rotor off")
    rig.pass_time("1s")
    rig.control.do("fault stage.temperature high")
    rig.pass_time("1s")
    counters = usb.counters()
    assert (counters["THERMAL_POWERSTEP01"], counters["STALL_POWERSTEP01"]) == (1, 1)
    assert usb.status() & HI_Z


def test_a_command_refused_over_modbus_is_counted_too(rig, usb):
    lan = rig.modbus_logged_in()
    usb.do(RUN_F, 200)
    lan.write(modbus.CMD, modbus.MOVE_F)
    lan.write(modbus.CMD, modbus.MOVE_F)
    assert usb.counters()["COMMAND_POWERSTEP01"] == 2, "also when CMD_ERROR was set already"


def test_a_ninth_connection_is_counted(rig, usb):
    opened = [rig.modbus() for _ in range(8)]
    assert "SOCKET" not in usb.counters()
    assert rig.modbus().is_closed_by_controller()
    assert usb.counters()["SOCKET"] == 1
    assert not opened[0].flag(modbus.ACCESS)


def test_half_a_packet_is_counted_once_it_is_dropped(usb):
    usb.line.write(stuffed(packet(VERSION_GET))[:4])
    time.sleep(HALF_PACKET_SECONDS + 0.2)
    assert usb.counters() == {"TIME_OUT": 1}
