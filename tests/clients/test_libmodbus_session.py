"""The essentials again through libmodbus, and what mbpoll can do with one connection for each run."""

import subprocess
import time

import pytest

from controller import *
from libmodbus import Libmodbus, LibmodbusError
from rig import HOST


@pytest.fixture
def connect_libmodbus(rig):
    """Opens connections by libmodbus, and closes them when the test is over."""
    opened = []

    def open_one(unit=None) -> Libmodbus:
        client = Libmodbus(rig.port, unit)
        opened.append(client)
        return client

    yield open_one
    for client in opened:
        client.close()


@pytest.fixture
def stage(connect_libmodbus) -> Libmodbus:
    """A connection that is logged in."""
    client = connect_libmodbus()
    client.log_in()
    return client


def test_log_in_and_identification(connect_libmodbus, model):
    client = connect_libmodbus(unit=1)
    assert client.input(HW_MAJOR, 4) == [6 if model == "SMSD-4.2LAN" else 7, 1, 1, 3]
    assert refusal(client.holding, MAX_SPEED, 1) == ILLEGAL_ADDRESS
    assert client.try_password(PASSWORD - 1) is False
    assert client.try_password(PASSWORD) is False
    time.sleep(LOCKOUT_SECONDS + 0.05)
    client.log_in()
    assert client.holding(MAX_SPEED, 1) == [1000]


def test_exceptions_arrive_as_errno(stage):
    assert refusal(stage.holding, 0x9000, 1) == ILLEGAL_ADDRESS
    assert refusal(stage.input, MAX_SPEED, 1) == ILLEGAL_ADDRESS
    assert refusal(stage.write, MAX_SPEED, 15) == ILLEGAL_VALUE
    assert refusal(stage.write_many, CURRENT_OR_VOLTAGE, [1, 0, 8]) == ILLEGAL_VALUE
    assert refusal(stage.mask_write, MAX_SPEED, 0xFFFF, 1) == ILLEGAL_FUNCTION
    assert refusal(stage.write_and_read, MAX_SPEED, [900], MAX_SPEED, 1) == ILLEGAL_FUNCTION
    stage.command(CMD_HARD_STOP)
    assert refusal(stage.write, MICROSTEPPING, 2) == BUSY
    assert stage.holding(MAX_SPEED, 1) == [1000]


def test_a_session_of_motion(stage):
    stage.write_many(CURRENT_OR_VOLTAGE, [1, 0, 4, 20, 2])
    stage.set_drive(max_speed=1_600)
    stage.command(MOVE_F, 100 * MICRO)
    assert stage.flag(STOP) is False
    stage.wait_ready()
    assert stage.position() == 100 * MICRO
    assert stage.move(GO_TO, -50 * MICRO) == -50 * MICRO
    stage.command(RUN_F, speed=800)
    stage.wait_ready()
    assert stage.speed() == 800
    stage.write_coil(SOFT_STOP, True)
    wait_until(lambda: stage.flag(STOP), what="standstill")
    assert stage.move(SCAN_ZERO_R, speed=1_000) == 0
    mark = stage.move(SCAN_MARK_F, speed=1_600)
    assert abs(mark - 400 * MICRO) <= 1
    assert stage.move(GO_ZERO) == 0
    stage.write_coils(HARD_HIZ, [True, True])
    assert stage.flag(HIZ) is True
    assert stage.coils(HARD_HIZ, 2) == [False, True]


def test_a_program_of_100_lines_survives_a_kill(rig, connect_libmodbus, stage):
    lines = program_of(100)
    stage.store_program(1, lines)
    assert stage.load_program(1) == lines
    rig.kill()
    rig.start()
    again = connect_libmodbus()
    again.log_in()
    assert again.load_program(1) == lines


def test_applying_a_unit_id_ends_the_connection(connect_libmodbus, stage):
    stage.write(LAN_ID, 7)
    stage.write_coil(APPLY, True)

    def is_closed():
        try:
            stage.input(HW_MAJOR, 1)
        except LibmodbusError:
            return True
        return False

    wait_until(is_closed, 2, "the end of the connection")

    def answers():
        try:
            return connect_libmodbus(unit=7).input(HW_MAJOR, 1) != []
        except LibmodbusError:
            return False

    wait_until(answers, 3, "an answer from unit 7")


def mbpoll(rig, *options) -> subprocess.CompletedProcess:
    """One poll, by the addresses of the PDU."""
    command = ["mbpoll", "-m", "tcp", "-0", "-1", "-p", str(rig.port), *options, HOST]
    return subprocess.run(command, capture_output=True, text=True, timeout=10)


def values(poll: subprocess.CompletedProcess) -> dict[int, int]:
    """What mbpoll prints as `[32769]: 6`."""
    lines = [line for line in poll.stdout.splitlines() if line.startswith("[")]
    return {int(line[1 : line.index("]")]): int(line.split(":")[1].split()[0], 0) for line in lines}


def test_mbpoll_reads_what_is_open(rig, model):
    poll = mbpoll(rig, "-t", "3", "-r", str(HW_MAJOR), "-c", "4")
    assert poll.returncode == 0, poll.stderr
    hw_major = 6 if model == "SMSD-4.2LAN" else 7
    assert values(poll) == {0x8001: hw_major, 0x8002: 1, 0x8003: 1, 0x8004: 3}
    poll = mbpoll(rig, "-t", "1", "-r", str(ACCESS))
    assert values(poll) == {ACCESS: 0}


def test_mbpoll_names_the_exception_for_what_is_not(rig):
    poll = mbpoll(rig, "-t", "4", "-r", str(MAX_SPEED))
    assert "Illegal data address" in poll.stdout + poll.stderr
    assert values(poll) == {}
