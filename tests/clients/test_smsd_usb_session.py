"""A working day of an SMSD on its USB port, by pyserial; Modbus, seen by pymodbus, is the other way to the same controller."""

import os
import stat

import pytest

import controller as modbus
from controller import MICRO
from smsd_usb import *

NEW_PASSWORD = bytes.fromhex("FAFBFE00FEFBFAFF")


@pytest.fixture
def rig(tmp_path):
    with UsbRig(tmp_path) as rig:
        yield rig


@pytest.fixture
def usb(rig):
    return rig.logged_in()


@pytest.mark.parametrize("transport", ["usb", "usb_tcp"])
@pytest.mark.parametrize("model", ["SMSD-4.2LAN", "SMSD-8.0LAN"])
def test_a_session_from_the_log_in_to_a_restart(tmp_path, model, transport):
    with UsbRig(tmp_path, model, clock="real") as rig:
        usb = rig.open(transport)
        usb.log_in()
        identify(usb, model)
        configure(usb)
        find_zero_and_mark(usb)
        go_round(usb)
        turn_and_stop(usb)
        rig.close_clients()
        rig.restart()
        after_a_restart(rig.open(transport))


def identify(usb, model):
    assert usb.versions() == (6 if model == "SMSD-4.2LAN" else 7, 1, 1, 3, 2)
    assert usb.do(GET_MODE) == 1 | 4 << 7 | 10 << 10 | 1 << 17, "current control, 1/16, 1.0 A, 50 %"
    assert (usb.do(GET_MIN_SPEED), usb.do(GET_MAX_SPEED)) == (0, 1000)
    assert usb.position() == 0
    assert usb.status() & (HI_Z | READY | MOT_STATUS) == HI_Z | READY


def configure(usb):
    usb.do(SET_MODE, 10813)
    assert usb.do(GET_MODE) == 10813, "motor 30, 25 % when it stands"
    usb.do(SET_MIN_SPEED, 50)
    usb.do(SET_MAX_SPEED, 2000)
    usb.do(SET_ACC, 20000)
    usb.do(SET_DEC, 20000)
    usb.do(SET_FS_SPEED, 15600)
    assert (usb.do(GET_MIN_SPEED), usb.do(GET_MAX_SPEED)) == (50, 2000)


def find_zero_and_mark(usb):
    usb.do(SCAN_ZERO_R, 800)
    usb.wait_ready()
    assert usb.position() == 0
    usb.do(MOVE_F, 150 * MICRO)
    usb.wait_ready()
    usb.do(SCAN_LABEL_F, 800)
    usb.wait_ready()
    mark = usb.position()
    assert mark == 400 * MICRO, "from the zero switch to the other"
    usb.do(GO_ZERO)
    usb.wait_ready()
    usb.do(GO_LABEL)
    usb.wait_ready()
    assert usb.position() == mark


def go_round(usb):
    for code, data, end in [
        (GO_TO, -1234, -1234), (MOVE_R, 66, -1300), (MOVE_F, -1, -1301), (MOVE_F, 1, -1300), (GO_TO_F, 5, 5), (GO_TO_R, -5, -5),
    ]:
        answer = usb.give(code, data)
        assert (answer.kind, answer.code) == (POWERSTEP01, OK) and not answer.status & (CMD_ERROR | HI_Z), (code, answer)
        usb.wait_ready()
        assert usb.position() == end, (code, data)
    assert usb.do(GET_ABS_POS) == 0xFFFFFFFB, "negative in all of its 32 bits"
    usb.do(RESET_POS)
    assert usb.position() == 0


def turn_and_stop(usb):
    answer = usb.give(RUN_R, 500)
    assert answer.status & FORWARD == 0 and answer.status & HI_Z == 0
    usb.wait_ready()
    assert usb.status() & MOT_STATUS == MOT_STATUS, "constant speed"
    assert abs(usb.do(GET_SPEED) - 500) <= 8
    assert usb.give(MOVE_F, 100).status & CMD_ERROR, "it turns"
    assert usb.give(GET_STATUS_AND_CLR).status & CMD_ERROR, "the status before it is cleared"
    assert not usb.status() & CMD_ERROR
    usb.do(SOFT_STOP)
    usb.wait_ready()
    assert usb.status() & (MOT_STATUS | HI_Z) == 0, "it holds"
    usb.do(HARD_HI_Z)
    assert usb.status() & HI_Z
    assert usb.position() < 0


def after_a_restart(usb):
    assert usb.code(CONFIG_GET) == ERROR_ACCESS
    usb.log_in()
    assert usb.position() == 0
    assert usb.do(GET_MODE) == 10813, "kept"
    assert usb.do(GET_MAX_SPEED) == 1000, "not kept"


# Logging in


def test_nobody_logs_in_within_a_second_of_power_up(rig):
    usb = rig.open()
    for _ in range(3):
        assert usb.try_password(PASSWORD) == ERROR_ACCESS_TIMEOUT
    rig.pass_time("999ms")
    assert usb.try_password(PASSWORD) == ERROR_ACCESS_TIMEOUT
    rig.pass_time("1ms")
    assert usb.try_password(PASSWORD) == OK_ACCESS, "those that came too early did not start the second anew"
    assert usb.position() == 0


def test_a_second_passes_between_attempts_whatever_became_of_the_first(rig):
    usb = rig.open()
    rig.pass_time("1s")
    assert usb.try_password(bytes(8)) == ERROR_ACCESS
    assert usb.try_password(PASSWORD) == ERROR_ACCESS_TIMEOUT
    assert usb.code(CONFIG_GET) == ERROR_ACCESS
    rig.pass_time("1s")
    assert usb.try_password(PASSWORD) == OK_ACCESS
    assert usb.try_password(PASSWORD) == ERROR_ACCESS_TIMEOUT
    assert usb.position() == 0, "who is logged in stays so"
    other = rig.open("usb_tcp")
    assert other.try_password(PASSWORD) == ERROR_ACCESS_TIMEOUT, "it is one second for all"
    rig.pass_time("1s")
    assert other.try_password(PASSWORD) == OK_ACCESS


def test_a_wrong_password_at_one_port_makes_the_other_wait_too(rig):
    usb, lan = rig.open(), rig.modbus()
    rig.pass_time("1s")
    assert usb.try_password(PASSWORD[::-1][:4] + PASSWORD[4:]) == ERROR_ACCESS
    assert lan.try_password(modbus.PASSWORD) is False
    rig.pass_time("1s")
    assert lan.try_password(modbus.PASSWORD) is True
    assert rig.modbus().try_password(modbus.PASSWORD + 1) is False
    assert usb.try_password(PASSWORD) == ERROR_ACCESS_TIMEOUT
    rig.pass_time("1s")
    assert usb.try_password(PASSWORD) == OK_ACCESS


def test_the_factory_password_is_taken_in_the_order_in_which_it_is_printed_too(rig):
    usb = rig.open()
    rig.pass_time("1s")
    assert usb.try_password(bytes.fromhex("0123456789ABCDEF")) == OK_ACCESS
    assert usb.position() == 0


def test_before_the_log_in_everything_is_refused_and_nothing_done(rig):
    usb = rig.open()
    for code in range(0x40):
        assert usb.refusal(code) == ERROR_ACCESS, f"{code:02X}"
    assert usb.write_memory(0, [word(SET_RELE)]) == ERROR_ACCESS
    for kind in [*range(R_MEM0, R_MEM0 + 4), CONFIG_GET, ERROR_GET, VERSION_GET]:
        assert usb.code(kind) == ERROR_ACCESS, kind
    assert usb.set_lan(Lan(bytes(6), bytes(4), bytes(4), bytes(4), bytes(4), 1502, 1, 9)) == ERROR_ACCESS
    assert usb.set_password(NEW_PASSWORD) == ERROR_ACCESS
    for kind, data in [(RESPONSE, b""), (15, b""), (0xFF, b""), (POWERSTEP01, b"123")]:
        assert usb.code(kind, data) == ERROR_ACCESS, (kind, data)
    assert usb.code(REQUEST, b"1234567") == ERROR_LEN
    rig.pass_time("1s")
    assert usb.try_password(PASSWORD) == OK_ACCESS
    assert (usb.position(), usb.relay_is_on(), usb.read_memory(0), usb.lan().ident) == (0, False, [], 1)


def test_a_log_in_ends_when_the_port_is_closed_and_when_the_power_goes(rig, usb):
    usb.do(RUN_F, 100)
    rig.close(usb)
    again = rig.open()
    assert again.refusal(HARD_STOP) == ERROR_ACCESS
    rig.pass_time("1s")
    assert again.try_password(PASSWORD) == OK_ACCESS
    assert again.status() & MOT_STATUS == MOT_STATUS, "the motor went on meanwhile"
    rig.control.do("power stage off")
    again.line.send(packet(VERSION_GET, ident=9))
    assert again.line.is_silent()
    rig.control.do("power stage on")
    assert again.refusal(GET_ABS_POS) == ERROR_ACCESS
    assert again.try_password(PASSWORD) == ERROR_ACCESS_TIMEOUT
    rig.pass_time("1s")
    assert again.try_password(PASSWORD) == OK_ACCESS
    assert again.status() & HI_Z


def test_a_log_in_ends_also_when_the_port_is_opened_again_at_once(rig):
    for _ in range(50):
        usb = rig.logged_in()
        usb.close()
        usb = rig.open()
        assert usb.refusal(GET_ABS_POS) == ERROR_ACCESS
        usb.close()


def test_two_clients_take_turns_at_the_serial_port(rig):
    assert stat.S_ISCHR(os.stat(rig.drive["usb"]).st_mode)
    for turn in range(10):
        usb = rig.logged_in()
        usb.do(SET_MAX_SPEED, 100 + turn)
        usb.line.write(stuffed(packet(ERROR_GET)) * 20 + stuffed(packet(VERSION_GET))[:5])
        # As with a real port, what is answered after it was opened again would be read.
        rig.close(usb)
        usb = rig.logged_in()
        assert usb.do(GET_MAX_SPEED) == 100 + turn
        rig.close(usb)


def test_clients_over_tcp_are_sessions_of_their_own(rig):
    first = rig.logged_in("usb_tcp")
    others = [rig.open("usb_tcp") for _ in range(7)]
    assert first.position() == 0
    for other in others:
        assert other.refusal(GET_ABS_POS) == ERROR_ACCESS
    pty = rig.logged_in()
    for number, client in enumerate([first, pty] * 3):
        client.do(SET_MAX_SPEED, 500 + number)
    assert first.do(GET_MAX_SPEED) == pty.do(GET_MAX_SPEED) == 505


def test_the_serial_port_is_gone_when_the_rig_is(rig):
    rig.stop()
    assert not os.path.lexists(rig.drive["usb"])
    rig.start()
    assert os.path.lexists(rig.drive["usb"])


# The same controller by Modbus


def test_what_one_port_sets_the_other_reads(rig, usb):
    lan = rig.modbus_logged_in()
    usb.do(SET_MODE, 10813)
    names = modbus.CURRENT_OR_VOLTAGE
    assert lan.holding(names, 5) == [1, 30, 4, 10, 0]
    lan.write_many(names, [1, 3, 5, 12, 2])
    assert usb.do(GET_MODE) == 1 | 3 << 1 | 5 << 7 | 12 << 10 | 2 << 17
    for number, code in enumerate([SET_MIN_SPEED, SET_MAX_SPEED, SET_ACC, SET_DEC, SET_FS_SPEED]):
        usb.do(code, 900 + number)
    assert lan.holding(modbus.MIN_SPEED, 5) == [900, 901, 902, 903, 904]
    lan.write_many(modbus.MIN_SPEED, [10, 1200])
    assert (usb.do(GET_MIN_SPEED), usb.do(GET_MAX_SPEED)) == (10, 1200)
    usb.do(SET_RELE)
    assert lan.coils(modbus.RELAY, 1) == [True]
    lan.write_coil(modbus.RELAY, False)
    assert not usb.relay_is_on()


def test_both_see_the_same_motion(rig, usb):
    lan = rig.modbus_logged_in()
    usb.do(RUN_R, 700)
    for _ in range(10):
        rig.pass_time("100ms")
        answer = usb.give(GET_ABS_POS)
        assert lan.status() == answer.status
        assert (lan.position(), lan.speed()) == (usb.position(), usb.do(GET_SPEED))
        assert lan.input(modbus.ABS_POS + 2, 1) == [usb.do(GET_EL_POS)]
    lan.command(modbus.CMD_HARD_STOP)
    assert usb.status() & MOT_STATUS == 0
    usb.do(GO_TO, -33)
    rig.run()
    assert lan.position() == -33


def test_inputs_their_mask_and_what_is_waited_for(rig, usb):
    lan = rig.modbus_logged_in()
    assert usb.do(STATUS_IN_EVENT) == 0xFF << 8
    rig.control.do("input stage.IN0 1", "input stage.CONTINUE 1")
    assert usb.do(STATUS_IN_EVENT) == 0xFF << 8 | 0x81
    usb.do(SET_MASK_EVENT, 0b1111_1011)
    assert usb.do(STATUS_IN_EVENT) == 0xFB << 8 | 0x81
    usb.do(SCAN_LABEL_F, 100)
    value = usb.do(STATUS_IN_EVENT)
    assert value == 0x02 << 16 | 0xFB << 8 | 0x81, "it waits for IN1"
    registers = lan.input(modbus.INPUTS, 1) + lan.holding(modbus.MASK, 2)
    assert registers == [value & 0xFF, value >> 8 & 0xFF, value >> 16]
    usb.do(HARD_HI_Z)
    lan.write(modbus.MASK, 0)
    assert usb.do(STATUS_IN_EVENT) == 0x81


# Programs


def long_program() -> list[int]:
    """As many instructions as there is room for; start, stop and escape bytes stand at every place where they can."""
    leg = [
        word(SET_ACC, 0xFA << 6), word(SET_DEC, 0xFB << 6), word(SET_ACC, 0xFE << 6),
        word(SET_WAIT, 0x3E), word(SET_WAIT, 0x3F), word(SET_WAIT_2, 0x3E),
        word(GO_TO, 0xFA << 14), word(GO_TO, 0xFB << 14), word(GO_TO, 0xFE << 14), word(MOVE_F, -1),
    ]
    program = [word(SET_MAX_SPEED, 15600), *leg * 25]
    return program + [word(SET_RELE)] * (LINES - 1 - len(program)) + [word(END)]


def test_a_memory_of_255_instructions_is_written_read_and_run(rig, usb):
    program = long_program()
    written = b"".join(line.to_bytes(4, "little") for line in program)
    for special in (START, STOP, ESCAPE):
        assert all(any(written[line + place] == special for line in range(0, 1020, 4)) for place in (1, 2, 3))
    for area in range(4):
        assert usb.read_memory(area) == []
        assert usb.write_memory(area, program) == OK
        assert usb.read_memory(area) == program
    lan = rig.modbus_logged_in()
    rig.control.clock("x100")
    assert lan.load_program(2) == program
    rig.control.clock("paused")
    usb.do(START_PROGRAM_MEM0 + 2)
    assert lan.flag(modbus.PROGRAM_RUN)
    rig.control.run_until("not stage.PROGRAM_RUN", within="10min")
    assert usb.position() == (0xFE << 14) - (1 << 22) - 1
    assert usb.relay_is_on() and not usb.status() & CMD_ERROR
    assert "WORK_PROGRAM" not in usb.counters()


def test_a_client_that_always_writes_a_whole_memory_pads_it_with_ends(rig, usb):
    program = [word(SET_RELE), word(MOVE_F, 16), *[word(END)] * 253]
    assert usb.write_memory(0, program) == OK
    assert usb.read_memory(0) == program
    usb.do(START_PROGRAM_MEM0)
    rig.run("not stage.PROGRAM_RUN")
    assert usb.relay_is_on() and usb.position() == 16


def test_a_program_written_by_modbus_is_read_and_an_empty_one_empties(rig, usb):
    lan = rig.modbus_logged_in()
    program = modbus.program_of(100)
    rig.control.clock("x100")
    lan.store_program(3, program)
    assert usb.read_memory(3) == program
    assert usb.write_memory(3, program[:7]) == OK
    assert lan.program_size(3) == 7 and lan.load_program(3) == program[:7]
    assert usb.write_memory(3, []) == OK
    assert usb.read_memory(3) == [] and lan.program_size(3) == 0


def test_where_a_program_is_and_what_it_waits_for(rig, usb):
    program = [word(CALL_PROGRAM, 3 << 8 | 250), word(END)]
    assert usb.write_memory(1, program) == OK
    assert usb.write_memory(3, [word(END)] * 250 + [word(WAIT_IN1), word(RETURN_PROGRAM)]) == OK
    usb.do(START_PROGRAM_MEM0 + 1)
    rig.pass_time("50ms")
    assert usb.do(GET_STACK) == 3 << 8 | 250
    assert usb.do(STATUS_IN_EVENT) >> 16 == 0b10
    assert usb.write_memory(3, program) == ERROR_WRITE, "it is executing"
    assert usb.write_memory(0, program) == OK
    assert usb.read_memory(3)[250:] == [word(WAIT_IN1), word(RETURN_PROGRAM)]
    rig.control.do("input stage.IN1 1")
    rig.run("not stage.PROGRAM_RUN")
    assert usb.write_memory(3, program) == OK


@pytest.mark.parametrize(
    ("wrong", "code"),
    [(0x3F << 4, ERROR_NO_COMMAND), (word(RUN_F, 100) | 1, ERROR_RANGE), (word(RUN_F, 100) | 8, ERROR_RANGE)],
)
def test_a_program_with_a_wrong_instruction_is_not_stored(usb, wrong, code):
    good = [word(SET_MAX_SPEED, 500 + number) for number in range(20)]
    assert usb.write_memory(0, good) == OK
    for place in (0, 10, 19):
        assert usb.write_memory(0, [*good[:place], wrong, *good[place + 1 :]]) == code
        assert usb.read_memory(0) == good


def test_what_is_written_survives_a_kill(rig, usb):
    program = [word(MOVE_F, number) for number in range(LINES)]
    assert usb.write_memory(2, program) == OK
    assert usb.set_password(NEW_PASSWORD) == OK
    rig.kill()
    rig.close_clients()
    rig.start()
    usb = rig.open()
    rig.pass_time("1s")
    assert usb.try_password(NEW_PASSWORD) == OK_ACCESS
    assert usb.read_memory(2) == program


# Password and LAN parameters


def test_a_new_password_counts_for_both_ports_and_after_a_restart(rig, usb):
    assert usb.set_password(NEW_PASSWORD) == OK
    assert usb.position() == 0, "who is logged in stays so"
    for _ in range(2):
        other = rig.open("usb_tcp")
        for wrong in (PASSWORD, PASSWORD[::-1], NEW_PASSWORD[::-1]):
            rig.pass_time("1s")
            assert other.try_password(wrong) == ERROR_ACCESS
        rig.pass_time("1s")
        assert other.try_password(NEW_PASSWORD) == OK_ACCESS
        lan = rig.modbus()
        assert lan.try_password(int.from_bytes(NEW_PASSWORD, "little"))
        rig.close_clients()
        rig.restart()
    lan = rig.modbus()
    lan.log_in(int.from_bytes(NEW_PASSWORD, "little"))
    lan.write_many(modbus.PASSWORD_LOW32, modbus.password_words(modbus.PASSWORD) + [1])
    usb = rig.logged_in()
    assert usb.position() == 0


def test_lan_parameters_set_at_one_port_are_read_at_the_other(rig, usb):
    assert usb.lan() == FACTORY_LAN._replace(port=rig.modbus_port())
    wanted = Lan(
        bytes.fromhex("02FAFBFE00FF"), b"\x0a\xfe\xfa\xfb", b"\xff\xff\xfe\x00", b"\x0a\xfe\xfa\x01", b"\x08\x08\x04\x04",
        free_port(), 2, 0xF7,
    )
    assert usb.set_lan(wanted) == OK
    assert usb.lan() == wanted, "the port goes on"
    wait_listening(wanted.port)
    lan = rig.modbus(wanted.port, wanted.ident)
    lan.log_in()
    assert lan.holding(modbus.LAN_ID, 25) == registers(wanted)
    back = wanted._replace(ident=7, port=free_port(), ip=b"\x01\x02\x03\x04", dhcp=1)
    lan.write_many(modbus.LAN_ID, registers(back))
    lan.write_coil(modbus.APPLY, True)
    assert usb.lan() == back
    rig.close_clients()
    rig.restart()
    assert rig.logged_in().lan() == back
    rig.modbus(back.port, 7).log_in()


def registers(lan: Lan) -> list[int]:
    """0x7000 to 0x7018."""
    return [lan.ident, *lan.mac, *lan.ip, *lan.subnet_mask, *lan.gateway, *lan.dns, lan.port, lan.dhcp]


def test_lan_parameters_out_of_their_ranges_are_refused_whole(usb):
    before = usb.lan()
    for wrong in [{"dhcp": 0}, {"dhcp": 3}, {"port": 0}, {"ident": 0}, {"ident": 248}, {"ident": 255}]:
        assert usb.set_lan(before._replace(ip=b"\x01\x02\x03\x04", **wrong)) == ERROR_RANGE, wrong
        assert usb.lan() == before
    assert usb.code(CONFIG_SET, before.pack()[:25]) == ERROR_LEN, "the form of the standard firmware"
    assert usb.code(CONFIG_SET, before.pack() + b"\0") == ERROR_LEN
