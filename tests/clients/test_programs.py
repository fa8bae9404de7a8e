"""User programs through pymodbus: stored, started, watched, stopped, read back."""

import json
import os
import subprocess

from controller import (
    BUSY, CMD_ERROR, MEM_ERASE, MEM_CMD, MODE_N_PROGRAMS, N_COMMAND, N_PROG, N_PROGRAM, PROGRAM_RUN, WAIT,
    refusal, wait_until,
)

START_PROGRAM_MEM0, START_PROGRAM_MEM3, STOP_PROGRAM_MEM = 0x2F, 0x32, 0x33

HOME_AND_SHUTTLE = """
    SET_MIN_SPEED 50
    SET_ACC 20000
    SET_DEC 20000
    SET_MAX_SPEED 1000
    SCAN_ZERO_R 800         ; line 4
again:
    GO_TO 1600              ; line 5
    SET_WAIT 200ms
    GO_TO 0
    SET_WAIT_2 200ms
    GOTO_PROGRAM again      ; line 9
"""


def build(text: str, memory: int = 0) -> list[int]:
    """The words of a program, by the assembler."""
    command = [os.environ["STEPDRIVE"], "program", "build", "-", "--json"]
    built = subprocess.run(command, input=text, capture_output=True, text=True, check=True)
    return json.loads(built.stdout)["memories"][memory]


def line(stage) -> tuple[int, int]:
    """The running memory area and line."""
    return tuple(stage.input(N_PROGRAM, 2))


def test_a_program_homes_and_shuttles_until_it_is_stopped(stage):
    program = build(HOME_AND_SHUTTLE)
    stage.store_program(0, program)
    assert stage.load_program(0) == program

    stage.command(START_PROGRAM_MEM0)
    assert stage.flag(PROGRAM_RUN)
    wait_until(lambda: line(stage) == (0, 4), what="the search for zero")
    assert stage.holding(WAIT, 1) == [0b100], "it waits for SET_ZERO"
    wait_until(lambda: line(stage)[1] >= 5, what="the end of the search")
    # Zero is where the switch was met; from there it shuttles between 0 and 1600.
    for _ in range(3):
        wait_until(lambda: line(stage) == (0, 6), what="the far end")
        assert stage.position() == 1600
        wait_until(lambda: line(stage) == (0, 8), what="the near end")
        assert stage.position() == 0

    wait_until(lambda: line(stage) == (0, 5), what="the way out")
    stage.command(STOP_PROGRAM_MEM)
    assert not stage.flag(PROGRAM_RUN)
    stage.wait_ready()
    assert stage.position() == 1600, "the move that was under way went on to its end"
    assert stage.load_program(0) == program


def test_the_area_that_runs_cannot_be_changed_and_another_can(stage):
    stage.store_program(3, build(".mem 3\nagain:\n WAIT_IN0\n GOTO_PROGRAM again\n", memory=3))
    stage.command(START_PROGRAM_MEM3)
    wait_until(lambda: line(stage) == (3, 0), what="line 0 of memory 3")
    assert stage.holding(WAIT, 1) == [0b1]
    stage.write(N_PROG, 3)
    assert refusal(stage.write, MEM_CMD, MEM_ERASE) == BUSY
    stage.store_program(0, build("END\n"))
    assert stage.flag(PROGRAM_RUN)
    stage.command(STOP_PROGRAM_MEM)


def test_a_program_error_ends_the_program_and_sets_cmd_error(stage):
    stage.store_program(0, build("SET_WAIT 5ms\nRETURN_PROGRAM\n"))
    stage.command(START_PROGRAM_MEM0)
    wait_until(lambda: not stage.flag(PROGRAM_RUN), what="the end of the program")
    assert stage.flag(CMD_ERROR)
    assert line(stage) == (0, 1)


def test_autonomous_mode_runs_its_program_at_power_up(rig, connect, stage):
    stage.store_program(2, build(".mem 2\nSET_ACC 20000\nSET_DEC 20000\nMOVE_F 320\n", memory=2))
    rig.stop()
    toml = rig.folder / "rig.toml"
    toml.write_text(toml.read_text().replace("[drive.motor]", "autonomous = true\nmode_n_programs = 2\n[drive.motor]"))
    rig.start()
    stage = connect()
    stage.log_in()
    assert stage.input(MODE_N_PROGRAMS, 1) == [2]
    wait_until(lambda: not stage.flag(PROGRAM_RUN), what="the end of the program")
    assert stage.position() == 320
