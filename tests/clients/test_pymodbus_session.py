"""Everything that a controller does, through pymodbus."""

import socket
import time

import pytest

from controller import *
from rig import HOST

# At power-up: HiZ, STOP and READY, and the last direction forward.
FLAGS_AT_POWER_UP = [True, True, False, False, False, True, False, False, True, False]
NEW_PASSWORD = 0xFEDCBA98_00C0FFEE


def limits(model):
    """Highest MOTOR_TYPE and WORK_CURRENT."""
    return (45, 42) if model == "SMSD-4.2LAN" else (54, 80)


# Authorisation


def test_identification_is_readable_before_log_in(connect, model):
    client = connect()
    assert client.input(HW_MAJOR, 4) == [6 if model == "SMSD-4.2LAN" else 7, 1, 1, 3]
    assert client.input(RM_MAJOR, 2) == [4, 3]
    assert refusal(client.input, HW_MAJOR, 8) == ILLEGAL_ADDRESS
    assert client.flag(ACCESS) is False


def test_all_else_is_refused_before_log_in(connect):
    client = connect()
    assert refusal(client.holding, MAX_SPEED, 1) == ILLEGAL_ADDRESS
    assert refusal(client.input, SPEED, 1) == ILLEGAL_ADDRESS
    assert refusal(client.discrete, HIZ, 1) == ILLEGAL_ADDRESS
    assert refusal(client.coils, RELAY, 1) == ILLEGAL_ADDRESS
    assert refusal(client.write, CMD, CMD_HARD_STOP) == ILLEGAL_ADDRESS
    assert refusal(client.write_coil, HARD_STOP, True) == ILLEGAL_ADDRESS
    assert refusal(client.write_many, LAN_ID, [7]) == ILLEGAL_ADDRESS
    client.log_in()
    assert client.flags() == FLAGS_AT_POWER_UP
    assert client.holding(CMD, 1) == [0]


def test_after_a_wrong_password_nothing_is_evaluated_for_a_second(connect):
    client = connect()
    assert client.try_password(PASSWORD ^ 1) is False
    failed_at = time.monotonic()
    assert client.try_password(PASSWORD) is False
    assert connect().try_password(PASSWORD) is False
    assert time.monotonic() - failed_at < LOCKOUT_SECONDS, "too slow to tell"
    time.sleep(failed_at + LOCKOUT_SECONDS + 0.05 - time.monotonic())
    assert client.try_password(PASSWORD) is True


def test_log_in_belongs_to_the_connection_and_may_be_one_write(connect):
    first, second = connect(), connect()
    first.write_many(PASSWORD_LOW32, password_words(PASSWORD) + [0])
    assert first.flag(ACCESS) is True
    assert second.flag(ACCESS) is False
    assert refusal(second.holding, MAX_SPEED, 1) == ILLEGAL_ADDRESS
    assert first.holding(PASSWORD_LOW32, 5) == [0] * 5
    assert refusal(first.write, PASSWORD_CMD, 2) == ILLEGAL_VALUE


# Configuration


def test_defaults_at_power_up(stage, model):
    assert stage.status() == 0x13
    assert stage.flags() == FLAGS_AT_POWER_UP
    assert stage.input(SPEED, 3) == [0, 0, 0]
    assert stage.holding(MIN_SPEED, 5) == [0, 1000, 1000, 1000, 15_600]
    assert stage.holding(CURRENT_OR_VOLTAGE, 7) == [1, 0, 4, 10, 1, 0xFF, 0]
    assert stage.coils(CLR, 8) == [False] * 8
    assert stage.coils(B_COMPLETE, 1) == [False]
    assert stage.flag(PROGRAM_RUN) is False
    assert stage.input(MODE_N_PROGRAMS, 3) == [0, 0, 0]
    assert stage.holding(LAN_ID, 11) == [1, 0x00, 0xF8, 0xDC, 0x3F, 0, 0, 192, 168, 1, 2]


def test_motor_configuration_takes_what_the_model_allows(stage, model):
    motor, current = limits(model)
    stage.write_many(CURRENT_OR_VOLTAGE, [0, motor, 7, current, 3])
    assert stage.holding(CURRENT_OR_VOLTAGE, 5) == [0, motor, 7, current, 3]
    for address, value in [
        (CURRENT_OR_VOLTAGE, 2),
        (MOTOR_TYPE, motor + 1),
        (MICROSTEPPING, 8),
        (WORK_CURRENT, current + 1),
        (WORK_CURRENT, 0),
        (STOP_CURRENT, 4),
    ]:
        assert refusal(stage.write, address, value) == ILLEGAL_VALUE
    assert refusal(stage.write_many, CURRENT_OR_VOLTAGE, [1, 1, 1, 1, 4]) == ILLEGAL_VALUE
    assert stage.holding(CURRENT_OR_VOLTAGE, 5) == [0, motor, 7, current, 3]


def test_drive_parameters_take_what_the_manual_allows(stage):
    for address, low, high in [
        (MIN_SPEED, 0, 950),
        (MAX_SPEED, 16, 15_600),
        (ACC, 15, 59_000),
        (DEC, 15, 59_000),
        (FS_SPEED, 15, 15_600),
        (TARGET_SPEED, 15, 15_600),
        (MASK, 0, 0xFF),
    ]:
        for value in (low, high):
            stage.write(address, value)
            assert stage.holding(address, 1) == [value]
        assert refusal(stage.write, address, high + 1) == ILLEGAL_VALUE
        assert low == 0 or refusal(stage.write, address, low - 1) == ILLEGAL_VALUE
        assert stage.holding(address, 1) == [high]
    for position in (-2_097_152, 2_097_151):
        stage.write_many(TARGET_POS, words(position))
        assert signed(*stage.holding(TARGET_POS, 2)) == position
    assert refusal(stage.write_many, TARGET_POS, words(2_097_152)) == ILLEGAL_VALUE
    assert refusal(stage.write_many, MIN_SPEED, [1, 100, 100, 14]) == ILLEGAL_VALUE
    assert stage.holding(MIN_SPEED, 4) == [950, 15_600, 59_000, 59_000]


def test_motor_configuration_wants_the_motor_de_energised(stage):
    stage.command(CMD_HARD_STOP)
    assert stage.flag(HIZ) is False
    assert refusal(stage.write, MICROSTEPPING, 3) == BUSY
    assert refusal(stage.write_many, CURRENT_OR_VOLTAGE, [1, 0, 4, 10, 1]) == BUSY
    stage.command(CMD_HARD_HI_Z)
    assert stage.flag(HIZ) is True
    stage.write(MICROSTEPPING, 3)
    assert stage.holding(MICROSTEPPING, 1) == [3]


# Motion


def test_a_move_is_watched_until_it_ends_exactly(stage):
    stage.set_drive(acc=5_000, dec=5_000)
    stage.command(MOVE_F, 100 * MICRO)
    seen, positions = [], []
    while not stage.flag(READY):
        seen.append(stage.flags())
        positions.append(stage.position())
    hiz, stop, _, _, _, ready, _, _, forward, error = seen[0]
    assert (hiz, stop, ready, forward, error) == (False, False, False, True, False)
    flags_seen = [any(column) for column in zip(*seen)]
    assert flags_seen[ACC_FLAG - HIZ] and flags_seen[DEC_FLAG - HIZ]
    assert positions == sorted(positions)
    assert len(set(positions)) > 3, "the position is seen on its way"
    assert stage.position() == 100 * MICRO
    assert stage.flags() == [False] + FLAGS_AT_POWER_UP[1:]
    assert (stage.speed(), stage.status()) == (0, 0x12)
    assert stage.holding(CMD, 1) == [MOVE_F]


def test_moves_there_and_back(stage):
    stage.set_drive()
    assert stage.move(MOVE_F, 40 * MICRO + 5) == 40 * MICRO + 5
    assert stage.move(MOVE_R, 20 * MICRO) == 20 * MICRO + 5
    assert stage.flag(DIR) is False
    assert stage.move(MOVE_F, -10 * MICRO) == 10 * MICRO + 5
    assert stage.move(GO_TO, -30 * MICRO) == -30 * MICRO
    assert stage.move(GO_TO_F, 30 * MICRO) == 30 * MICRO
    assert stage.move(GO_TO_R, 0) == 0
    assert stage.move(GO_TO, 0) == 0
    assert stage.move(GO_TO, 1) == 1
    assert stage.move(GO_ZERO) == 0
    assert stage.move(MOVE_F, 50) == 50
    stage.write_coil(RESET_POS, True)
    assert stage.position() == 0


def test_run_takes_a_new_max_speed_and_stops_softly(stage):
    stage.set_drive(acc=5_000, dec=5_000)
    stage.command(RUN_F, speed=800)
    stage.wait_ready()
    assert (stage.speed(), stage.flag(CONST_SPEED), stage.flag(STOP)) == (800, True, False)
    stage.write(MAX_SPEED, 500)
    # What the motor chip makes of 500 is 503.5.
    wait_until(lambda: stage.speed() in (503, 504), what="the new limit")
    assert refusal(stage.write, ACC, 100) == BUSY
    assert refusal(stage.write, DEC, 100) == BUSY
    assert refusal(stage.write, MIN_SPEED, 100) == BUSY
    assert stage.holding(MIN_SPEED, 4) == [0, 500, 5_000, 5_000]
    stage.command(CMD_SOFT_STOP)
    assert stage.flag(DEC_FLAG) is True
    stage.wait_ready()
    assert (stage.speed(), stage.flag(STOP), stage.flag(HIZ)) == (0, True, False)


def test_run_is_held_to_max_speed_and_turns_round_by_braking(stage):
    stage.set_drive(max_speed=1000, acc=8_000, dec=8_000)
    stage.command(RUN_F, speed=2_000)
    stage.wait_ready()
    # What the motor chip makes of 1000 is 1007.08.
    assert stage.speed() == 1007
    stage.command(RUN_R, speed=400)
    assert stage.flag(READY) is False
    stage.wait_ready()
    assert (stage.speed(), stage.flag(DIR), stage.flag(CONST_SPEED)) == (400, False, True)
    stage.write_coil(SOFT_HIZ, True)
    wait_until(lambda: stage.flag(STOP), what="standstill")
    assert stage.flag(HIZ) is True


def test_a_hard_stop_is_at_once(stage):
    stage.set_drive(dec=15)
    stage.command(RUN_F, speed=600)
    stage.wait_ready()
    stage.write_coil(HARD_STOP, True)
    assert (stage.flag(STOP), stage.speed(), stage.flag(HIZ), stage.flag(READY)) == (True, 0, False, True)
    stage.command(RUN_R, speed=600)
    stage.wait_ready()
    stage.command(CMD_HARD_HI_Z)
    assert (stage.flag(STOP), stage.speed(), stage.flag(HIZ), stage.flag(READY)) == (True, 0, True, True)
    assert stage.coils(CLR, 7) == [False] * 7


def test_commands_that_cannot_be_carried_out_set_cmd_error(stage):
    stage.set_drive()
    stage.command(RUN_F, speed=100)
    stage.wait_ready()
    stage.write_many(TARGET_POS, words(10))
    assert stage.command_is_refused(MOVE_F)
    assert stage.command_is_refused(MOVE_R)
    assert stage.speed() == 100
    stage.command(CMD_HARD_STOP)
    stage.write(TARGET_INPUT, 8)
    assert stage.command_is_refused(GO_UNTIL_F)
    assert stage.flag(STOP) is True
    for unlisted in (0x00, 0x0D, 0x1D, 0x1E, 0x23, 0x34, 0x3F, 0xFFFF):
        assert refusal(stage.write, CMD, unlisted) == ILLEGAL_VALUE
    assert stage.flag(CMD_ERROR) is False
    assert stage.holding(CMD, 1) == [GO_UNTIL_F], "the last code accepted"


def test_a_go_to_is_refused_while_another_motion_is_under_way(stage):
    stage.set_drive(acc=1_000, dec=1_000)
    stage.command(MOVE_F, 200 * MICRO)
    assert stage.flag(READY) is False
    assert stage.command_is_refused(GO_TO)
    assert stage.command_is_refused(GO_ZERO)
    stage.wait_ready()
    assert stage.position() == 200 * MICRO


def test_searches_for_zero_and_mark(stage):
    stage.set_drive(max_speed=2_000)
    assert stage.move(SCAN_ZERO_R, speed=600) == 0
    assert (stage.flag(STOP), stage.flag(HIZ), stage.speed()) == (True, False, 0)
    assert stage.input(INPUTS, 1)[0] & 1 << 2, "it stands on the SET_ZERO switch"
    # The zero is where the switch closes, at -100 steps; IN1 closes at 300.
    mark = stage.move(SCAN_MARK_F, speed=1_600)
    assert abs(mark - 400 * MICRO) <= 1
    assert stage.input(INPUTS, 1)[0] & 1 << 1, "it stands on the IN1 switch"
    assert stage.move(SCAN_MARK_F, speed=1_600) == mark, "the signal is there already"
    assert stage.move(GO_TO, 350 * MICRO) == 350 * MICRO
    assert stage.move(GO_MARK) == mark
    assert stage.move(GO_ZERO) == 0


def test_mark2_takes_the_mark_and_then_brakes(stage):
    stage.set_drive(max_speed=1_600, acc=20_000, dec=20_000)
    end = stage.move(SCAN_MARK2_F, speed=1_600)
    # Braking from 1600 steps/s with 20000 steps/s² takes 64 steps.
    assert 355 * MICRO < end < 375 * MICRO
    assert abs(stage.move(GO_MARK) - 300 * MICRO) <= 1


def test_go_until_brakes_behind_the_signal(stage):
    stage.set_drive(max_speed=1_600, acc=20_000, dec=20_000)
    stage.write(TARGET_INPUT, 1)
    end = stage.move(GO_UNTIL_F)
    assert 355 * MICRO < end < 375 * MICRO
    assert stage.flag(STOP) is True


def test_a_masked_input_never_comes(stage):
    stage.set_drive(max_speed=2_000)
    stage.write(MASK, 0xFF & ~(1 << 2))
    stage.command(SCAN_ZERO_R, speed=1_000)
    wait_until(lambda: stage.position() < -125 * MICRO, what="the far side of the switch")
    assert (stage.flag(STOP), stage.flag(READY)) == (False, False)
    stage.command(CMD_HARD_STOP)
    assert stage.position() < -125 * MICRO, "the position was not taken as zero"
    stage.write(MASK, 0xFF)
    assert stage.move(SCAN_ZERO_F, speed=1_000) == 0
    # It came from below this time, so zero is at -120 steps.
    assert abs(stage.move(SCAN_MARK_F, speed=1_600) - 420 * MICRO) <= 1


def test_reset_of_the_motor_chip(stage):
    stage.set_drive(max_speed=700)
    stage.write(MICROSTEPPING, 3)
    stage.move(MOVE_F, 50)
    stage.write_coil(RESET, True)
    assert stage.flags() == FLAGS_AT_POWER_UP
    assert stage.position() == 0
    assert stage.holding(MIN_SPEED, 5) == [0, 1000, 1000, 1000, 15_600]
    assert stage.holding(MICROSTEPPING, 1) == [3]


def test_relay_and_other_coils(stage):
    stage.write_coil(RELAY, True)
    assert stage.coils(CLR, 8) == [False] * 7 + [True]
    stage.write_coil(HARD_STOP, False)
    assert stage.flag(HIZ) is True, "FALSE triggers nothing"
    stage.write_coils(HARD_STOP, [True, False, False, False])
    assert stage.flag(HIZ) is False
    assert stage.coils(RELAY, 1) == [False]
    stage.write_coil(B_COMPLETE, True)
    assert stage.coils(B_COMPLETE, 1) == [False], "only the controller sets it"
    stage.write(WAIT, 0xFF)
    assert stage.holding(WAIT, 1) == [0]


# Memory


def test_a_program_of_100_lines_is_stored_and_read_back(stage):
    lines = program_of(100)
    assert len(set(lines)) == 100
    stage.store_program(2, lines)
    assert stage.load_program(2) == lines
    assert [stage.program_size(area) for area in range(4)] == [0, 0, 100, 0]
    stage.write(N_PROG, 2)
    stage.memory_procedure(MEM_ERASE)
    assert stage.program_size(2) == 0


def test_what_does_not_fit_the_memory_is_refused(stage):
    stage.store_program(0, program_of(3))
    stage.write_many(CMD_BUFFER, words(instruction(0x06, 100)))
    for area, line, size, code in [
        (4, 0, 1, MEM_READ),
        (0, 250, 6, MEM_WRITE),
        (0, 0, 0, MEM_WRITE),
        (0, 0, 33, MEM_READ),
    ]:
        stage.write_many(N_PROG, [area, line, size])
        assert refusal(stage.write, MEM_CMD, code) == ILLEGAL_VALUE
    for bad_line in (instruction(0x3F), instruction(0x06, 100) | 1):
        stage.write_many(CMD_BUFFER, words(bad_line))
        stage.write_many(N_PROG, [0, 0, 1])
        assert refusal(stage.write, MEM_CMD, MEM_WRITE) == ILLEGAL_VALUE
    assert refusal(stage.write, MEM_CMD, 5) == ILLEGAL_VALUE
    assert stage.coils(B_COMPLETE, 1) == [False]
    assert stage.load_program(0) == program_of(3)


def test_a_new_unit_id_is_applied(rig, connect, stage):
    stage.write(LAN_ID, 7)
    assert stage.holding(LAN_ID, 1) == [7]
    for address, value in [(LAN_ID, 0), (LAN_ID, 248), (LAN_IP, 256), (LAN_PORT, 0), (LAN_PORT + 1, 3)]:
        assert refusal(stage.write, address, value) == ILLEGAL_VALUE
    stage.write_coil(APPLY, True)
    assert stage.is_closed_by_controller()
    seventh = connect_again(connect, unit=7)
    seventh.log_in()
    assert seventh.holding(LAN_ID, 1) == [7]
    rig.restart()
    seventh = connect(unit=7)
    seventh.log_in()
    assert seventh.holding(LAN_ID, 1) == [7]
    assert connect(unit=0).input(HW_MAJOR, 2) and connect(unit=255).input(HW_MAJOR, 2)


def test_a_new_port_is_applied(rig, connect, stage):
    with socket.create_server((HOST, 0)) as holder:
        port = holder.getsockname()[1]
    stage.write(LAN_PORT, port)
    stage.write_coil(APPLY, True)
    assert stage.is_closed_by_controller()
    rig.port = port
    moved = connect_again(connect)
    moved.log_in()
    assert moved.holding(LAN_PORT, 1) == [port]


def connect_again(connect, unit=1):
    """Connects to a controller that is about to listen again."""
    clients = []

    def connects():
        try:
            clients.append(connect(unit))
        except AssertionError:
            return False
        return True

    wait_until(connects, 3, "the controller listening again")
    return clients[0]


def test_a_new_password_holds_from_the_next_log_in(rig, connect, stage):
    stage.write_many(PASSWORD_LOW32, password_words(NEW_PASSWORD))
    stage.write(PASSWORD_CMD, 1)
    assert stage.flag(ACCESS) is True
    connect().log_in(NEW_PASSWORD)
    assert connect().try_password(PASSWORD) is False
    rig.restart()
    connect().log_in(NEW_PASSWORD)


def test_a_password_is_not_changed_without_log_in(connect):
    client = connect()
    client.write_many(PASSWORD_LOW32, password_words(NEW_PASSWORD))
    assert refusal(client.write, PASSWORD_CMD, 1) == ILLEGAL_ADDRESS
    connect().log_in()


@pytest.mark.parametrize("ending", ["switched off", "killed"])
def test_what_is_stored_is_there_after_a_restart(rig, connect, stage, ending, model):
    _, current = limits(model)
    lines = program_of(100)
    stage.set_drive(max_speed=2_000)
    stage.write(MASK, 0x0F)
    stage.write_coil(RELAY, True)
    stage.write_many(CURRENT_OR_VOLTAGE, [0, 25, 6, current, 2])
    stage.write_many(PASSWORD_LOW32, password_words(NEW_PASSWORD) + [1])
    stage.store_program(3, lines)
    if ending == "killed":
        rig.kill()
        rig.start()
    else:
        rig.restart()
    again = connect()
    again.log_in(NEW_PASSWORD)
    assert again.load_program(3) == lines
    assert [again.program_size(area) for area in range(3)] == [0, 0, 0]
    assert again.holding(CURRENT_OR_VOLTAGE, 5) == [0, 25, 6, current, 2]
    assert again.holding(MIN_SPEED, 5) == [0, 1000, 1000, 1000, 15_600]
    assert again.holding(MASK, 1) == [0xFF]
    assert again.coils(RELAY, 1) == [False]
    assert again.flags() == FLAGS_AT_POWER_UP


def test_lan_parameters_are_not_stored_before_they_are_applied(rig, connect, stage):
    stage.write(LAN_ID, 9)
    rig.restart()
    again = connect(unit=1)
    again.log_in()
    assert again.holding(LAN_ID, 1) == [1]
