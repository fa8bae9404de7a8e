"""A working day of an SMD3, through pyserial: over the virtual COM port, and over TCP."""

import os
import stat
import time

import pytest

from smd3 import *


@pytest.fixture
def model():
    return "SMD3"


@pytest.fixture
def rig(tmp_path):
    """A running rig. It must still be running when the test is over, and end with 0."""
    rig = Smd3Rig(tmp_path)
    try:
        rig.start()
        yield rig
        assert rig.is_running(), rig.complaints()
        rig.stop()
    finally:
        rig.clean_up()


@pytest.fixture(params=["pty", "tcp"])
def transport(request) -> str:
    return request.param


@pytest.fixture
def connect(rig, transport):
    """Opens the drive's port, and closes it when the test is over."""
    opened = []

    def open_one() -> Smd3:
        drive = Smd3(rig.url(transport))
        opened.append(drive)
        return drive

    yield open_one
    for drive in opened:
        drive.close()


@pytest.fixture
def uhv(connect) -> Smd3:
    return connect()


def near(value, wanted, by=0.001):
    return abs(value - wanted) <= by * max(1.0, abs(wanted))


def configure(uhv):
    """Settings that the virtual stage likes."""
    for line in ["AMAX,16000", "DMAX,16000", "VMAX,800", "VSTOP,60", "VSTART,50", "TZW,0"]:
        name, wanted = line.split(",")
        assert near(uhv.get(line), float(wanted)), line
    for line in ["L,1", "L+,1", "L-,1", "LP+,0", "LP-,0", "LP,0", "LSM,0"]:
        assert uhv.ask(line).data == line.split(",")[1], line


def go(uhv, line) -> Reply:
    """Starts a motion, and waits until the motor stands again."""
    assert not uhv.do(line).has(STANDBY), "turning from the start"
    return uhv.wait(STANDBY)


def test_a_session_from_identification_to_a_restart(rig, connect):
    uhv = connect()
    identify(uhv)
    configure(uhv)
    set_currents(uhv)
    move(uhv)
    stop(uhv)
    run_into_limits(uhv)
    find_home(uhv)
    emergency(uhv)
    bake(uhv)
    store(uhv)
    assert uhv.transactions >= 40
    uhv.close()
    rig.restart()
    remembers(connect())


def identify(uhv):
    assert uhv.ask("SER").text == "0x0040,0x0000,20168-001"
    assert uhv.ask("FW").text == "0x0040,0x0000,20168.1"
    assert uhv.ask("IDENT,1").text == "0x0050,0x0000,1"
    assert uhv.ask("ident").text == "0x0050,0x0000,1"
    assert uhv.ask("IDENT,0").text == "0x0040,0x0000,0"
    assert uhv.ask("MODE").text == "0x0040,0x0000,2 (Remote)"
    assert uhv.ask("MODE,2").text == "0x0040,0x0000,2 (Remote)"
    flags = dict(line.split("\t") for line in uhv.ask("FLAGS").data.split("\n"))
    assert flags["STANDBY"] == "1" and flags["EMERGENCY STOP"] == "0"


def set_currents(uhv):
    assert uhv.ask("IR,0.5").text == "0x0040,0x0000,5.00000E-01"
    assert uhv.ask("IA,0.51").text == "0x0040,0x0000,5.00000E-01", "1/32 A is the step"
    assert uhv.ask("IH,0.1").text == "0x0040,0x0000,9.37500E-02"
    assert uhv.ask("PDDEL,100").text == "0x0040,0x0000,1.09227E+02"
    assert uhv.ask("RES,200").data == "256"
    assert uhv.ask("RES,64").data == "64"
    assert uhv.ask("TSEL").data == "0"
    assert near(uhv.get("TMOT"), 21.0, 0.5)


def move(uhv):
    """Relative, absolute, and to another place while turning."""
    uhv.do("RUNR,200")
    places = []
    while not (reply := uhv.ask("PACT")).has(STANDBY):
        places.append(float(reply.data))
    assert places == sorted(places) and len(set(places)) > 5, "on the way it is seen moving"
    assert reply.text == "0x0040,0x0000,2.00000E+02"
    assert uhv.get("VACT") == 0
    go(uhv, "RUNR,-50")
    assert (uhv.get("PACT"), uhv.get("PREL")) == (150, 150)
    uhv.do("RUNA,390")
    uhv.wait(ATSPEED)
    assert near(uhv.get("VACT"), 800)
    assert uhv.ask("RUNR,5").data == "-1 (Stop motor first)"
    assert uhv.ask("RES,8").data == "-1 (Stop motor first)"
    uhv.do("RUNA,-100")
    uhv.wait_until("VACT", lambda speed: speed < 0)
    uhv.wait(STANDBY)
    assert uhv.get("PACT") == -100
    go(uhv, "RUNA,0")


def stop(uhv):
    uhv.do("RUNV,+")
    uhv.wait(ATSPEED)
    uhv.do("STOP")
    uhv.wait(STANDBY)
    assert 0 < uhv.get("PACT") < 400
    uhv.do("RUNV,-")
    uhv.wait(ATSPEED)
    uhv.do("SSTOP")
    uhv.wait(STANDBY)
    assert uhv.get("PACT").is_integer(), "on a full step"
    if uhv.ask("").has(LIMIT_NEGATIVE | LIMIT_POSITIVE):
        uhv.ask("L,0")
    go(uhv, "RUNA,0")
    assert uhv.ask("L,1").text == "0x0040,0x0000,1"


def run_into_limits(uhv):
    """At speed, stopping at once and by the profile; then away again."""
    uhv.ask("VMAX,1500")
    uhv.do("RUNV,+")
    reply = uhv.wait(STANDBY)
    assert reply.has(LIMIT_POSITIVE)
    assert near(uhv.get("PACT"), 400)
    uhv.do("RUNV,+")
    assert uhv.get("VACT") == 0, "towards an active limit nothing moves"
    uhv.wait(STANDBY)
    assert near(uhv.get("PACT"), 400)
    go(uhv, "RUNA,0")
    assert uhv.ask("LSM,1").data == "1"
    uhv.do("RUNV,-")
    reply = uhv.wait(STANDBY)
    assert reply.has(LIMIT_NEGATIVE)
    assert uhv.get("PACT") < -450, "it takes its way to stop"
    assert uhv.ask("LSM,0").data == "0"
    go(uhv, "RUNA,0")


def find_home(uhv):
    assert uhv.ask("RUNH,-").data == "-6 (Not possible in mode)"
    assert uhv.ask("MODE,5").data == "5 (Home)"
    assert uhv.ask("RUNV,+").data == "-6 (Not possible in mode)"
    uhv.ask("VSTOP,200")
    uhv.ask("VSTART,200")
    reply = go(uhv, "RUNH,-")
    assert reply.has(LIMIT_NEGATIVE)
    assert (uhv.get("PACT"), uhv.get("PREL")) == (0, 0)
    uhv.ask("VSTART,50")
    uhv.ask("VSTOP,60")
    uhv.ask("VMAX,800")
    assert uhv.ask("MODE,2").data == "2 (Remote)"
    assert not go(uhv, "RUNA,400").has(LIMIT_NEGATIVE), "the stage is where it was, its zero is not"


def emergency(uhv):
    uhv.do("RUNV,+")
    uhv.wait(ATSPEED)
    reply = uhv.do("ESTOP")
    assert reply.eflags == EMERGENCY_STOP
    assert uhv.get("VACT") == 0
    assert uhv.ask("RUNV,+").data == "-7 (Not possible when motor disabled)"
    assert uhv.do("CLR").eflags == 0
    go(uhv, "RUNA,400")
    assert uhv.get("PACT") == 400


def bake(uhv):
    assert uhv.ask("MODE,4").data == "4 (Bake)"
    assert uhv.ask("BAKET,150").data == "150"
    assert uhv.do("RUNB").has(BAKE)
    first = uhv.get("TMOT")
    uhv.wait_until("TMOT", lambda celsius: celsius > first + 5)
    uhv.wait_until("TMOT", lambda celsius: abs(celsius - 150) < 1)
    reply = uhv.do("STOP")
    assert not reply.has(BAKE) and reply.has(STANDBY)
    uhv.wait_until("TMOT", lambda celsius: celsius < 100)
    uhv.ask("MODE,2")


def store(uhv):
    assert uhv.ask("BAKET,120").data == "120"
    assert uhv.do("STORE").text == "0x0040,0x0000"


def remembers(uhv):
    assert uhv.ask("BAKET").data == "120"
    assert uhv.ask("RES").data == "64"
    assert uhv.ask("L").data == "1"
    assert near(uhv.get("VMAX"), 800)
    assert uhv.get("PACT") == 0, "the position is not kept"
    assert uhv.ask("BAKET,99").data == "99"
    assert uhv.do("LOAD").text == "0x0040,0x0000"
    assert uhv.ask("BAKET").data == "120"
    uhv.do("LOADFD")
    assert uhv.ask("BAKET").data == "150"


def test_what_is_stored_survives_a_kill_in_the_middle_of_a_move(rig, connect):
    uhv = connect()
    uhv.ask("BAKET,77")
    uhv.do("STORE")
    uhv.do("RUNV,+")
    rig.kill()
    uhv.close()
    rig.start()
    again = connect()
    assert again.ask("BAKET").text == "0x0040,0x0000,77"
    assert again.get("PACT") == 0


def test_wrong_commands_are_answered_as_the_manual_prints_it(uhv):
    for line, error in [
        ("XYZZY", "-4 (Unknown command)"),
        ("RUNV", "-3 (Unable to get)"),
        ("LP", "-3 (Unable to get)"),
        ("VMAX,-5", "-2 (Argument validation)"),
        ("VMAX,1e999", "-2 (Argument validation)"),
        ("MODE,6", "-2 (Argument validation)"),
        ("RUNV,x", "-2 (Argument validation)"),
        ("RUNB", "-6 (Not possible in mode)"),
        ("RUNH,+", "-6 (Not possible in mode)"),
        ("RUNA,1.5", "-101 (Argument type)"),
        ("VMAX,nan", "-101 (Argument type)"),
        ("RES,0x", "-101 (Argument type)"),
        ("V" * 257, "-101 (Argument type)"),
        ("SER,1", "-102 (Argument count)"),
        ("VMAX,1,2", "-102 (Argument count)"),
        ("STOP,1", "-102 (Argument count)"),
    ]:
        assert uhv.ask(line).text == f"0x0040,0x0000,{error}", line
    assert uhv.ask("MODE,5").data == "5 (Home)"
    assert uhv.ask("RUNH,+").data == "-5 (Action failed)", "the limit is not enabled"
    uhv.ask("MODE,2")
    uhv.do("RUNV,+")
    assert uhv.ask("MODE,5").data == "-1 (Stop motor first)"
    uhv.do("ESTOP")
    assert uhv.ask("RUNR,1").text == "0x0040,0x0020,-7 (Not possible when motor disabled)"


def test_the_serial_port_can_be_closed_and_opened_at_any_time(rig):
    assert stat.S_ISCHR(os.stat(rig.serial).st_mode)
    for celsius in range(20):
        uhv = Smd3(rig.serial)
        assert uhv.ask(f"BAKET,{celsius}").data == str(celsius)
        uhv.port.write(b"FLAGS\r\n" * 20)
        uhv.close()
        # As with a real port, what the drive answers after it was opened again would be read.
        time.sleep(0.02)
    uhv = Smd3(rig.serial)
    uhv.do("RUNR,100")
    uhv.close()
    uhv = Smd3(rig.serial)
    uhv.wait(STANDBY)
    assert uhv.get("PACT") == 100, "the motor does not depend on the port"
    uhv.close()


def test_the_serial_port_is_gone_when_the_rig_is(rig):
    rig.stop()
    assert not os.path.lexists(rig.serial)
    rig.start()
    assert os.path.lexists(rig.serial)


def test_lines_end_as_a_terminal_program_ends_them(uhv):
    uhv.port.write(b"BAKET,1\rBAKET,2\nBAKET,3\r\n")
    for celsius in (b"1", b"2", b"3"):
        assert uhv.port.read_until(b"\r\n") == b"0x0040,0x0000," + celsius + b"\r\n"
