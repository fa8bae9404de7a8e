"""The command line against controllers that were written from the manuals alone; see `foreign.py`."""

import re
import time

import pytest
from foreign import (
    ABS_POS,
    ACCESS,
    CMD,
    COILS,
    DISCRETE_INPUTS,
    EMERGENCY_STOP,
    HOLDING_REGISTERS,
    INPUT_REGISTERS,
    READ_COILS,
    READ_HOLDING,
    READ_INPUT_REGISTERS,
    READ_INPUTS,
    READINGS,
    TARGET_POS,
    UNPLUG,
    WRITE_COIL,
    WRITE_REGISTER,
    WRITE_REGISTERS,
    Cli,
    Hangup,
    Peer,
    Smd3,
    Smsd,
    frame,
    reply_to,
)
from pymodbus.constants import ExcCodes

SHORT = ("--reply-timeout", "100ms")


@pytest.fixture
def cli(tmp_path) -> Cli:
    return Cli(tmp_path)


@pytest.fixture
def smsd():
    with Smsd() as smsd:
        yield smsd


@pytest.fixture
def at(smsd) -> list[str]:
    return ["-a", smsd.place]


# ---- an SMSD by pymodbus


@pytest.mark.parametrize("low_first", [True, False], ids=["low-first", "high-first"])
def test_the_word_order_is_found_and_the_status_shown(cli, low_first):
    with Smsd(low_first) as smsd:
        status = cli.json("status", "-a", smsd.place)
        assert status["controller"] == "SMSD-8.0LAN, hardware 1, firmware 1.3, register map 4.3"
        # 70 000 microsteps of 1/8 the other way.
        assert status["position_full_steps"] == -8750.0
        assert (status["moving"], status["energised"], status["trust"]) == (False, False, "unknown")
        target = f"smsd+tcp://{smsd.place}?word_order={'low-first' if low_first else 'high-first'}"
        (reading,) = cli.json("get", "-a", target, "TARGET_POS")["values"]
        assert reading["value"] == -123_456
        assert smsd.writes() == []


def test_a_word_order_that_is_wrong_is_not_accepted(cli, smsd):
    target = f"smsd+tcp://{smsd.place}?word_order=high-first"
    sentence = cli.fails(6, "get", "-a", target, "ACC")
    assert "does not accept the password, with word order high-first; nothing else was sent" in sentence
    assert smsd.writes() == []


# What tells nothing when it is read: passwords, and coils that act.
MUTE = {0x2100, 0x2102, 0x2104, 0x7400} | set(range(0x1400, 0x1407))


def test_every_address_of_the_manual_reads_as_what_is_there(cli, smsd, at):
    words = [(place, name, value) for place, name, _, value in INPUT_REGISTERS + HOLDING_REGISTERS]
    rows = [row for row in words + DISCRETE_INPUTS + COILS if row[0] not in MUTE]
    there = {0x1004: smsd.words[READ_INPUT_REGISTERS][0x1004], ACCESS: True}
    values = cli.json("get", *at, *[f"0x{place:04X}" for place, _, _ in rows])["values"]
    assert len(values) == len(rows) > 100
    for (place, name, value), found in zip(rows, values):
        # The manual numbers the instructions 00 to 31.
        expected = (re.sub(r"CMD 0(\d)", r"CMD \1", name), int(there.get(place, value)))
        assert (found["name"], found["value"]) == expected, hex(place)
    assert smsd.writes() == []


def test_the_whole_map_is_shown_with_what_differs_from_the_factory(cli, smsd, at):
    rows = {row["name"]: row for row in cli.json("regs", *at)["rows"] if row["table"] == "holding register"}
    shown = {int(row["address"], 16): row["value"] for row in rows.values()}
    for place, name, _, value in HOLDING_REGISTERS:
        if place < 0x2100:
            assert shown[place] == value, name
    assert rows["MAX_SPEED"] | {"default": 1000, "differs": True} == rows["MAX_SPEED"]
    assert rows["MICROSTEPPING"]["meaning"] == "1/8"
    assert smsd.writes() == []


SETTINGS = [
    ("MIN_SPEED", "40", 0x1100), ("MAX_SPEED", "15600", 0x1101), ("ACC", "59000", 0x1102), ("DEC", "15", 0x1103),
    ("FS_SPEED", "0x1000", 0x1104), ("TARGET_SPEED", "16", 0x1105), ("TARGET_INPUT", "3", 0x1108),
    ("CURRENT_OR_VOLTAGE", "1", 0x110A), ("MOTOR_TYPE", "54", 0x110B), ("MICROSTEPPING", "7", 0x110C),
    ("WORK_CURRENT", "80", 0x110D), ("STOP_CURRENT", "3", 0x110E), ("Mask", "0xFF", 0x110F), ("N_PROG", "3", 0x3180),
    ("N_STR", "254", 0x3181), ("SECTOR_SIZE", "1", 0x3182), ("PROG_SIZE", "255", 0x3183), ("IP 2", "99", 0x7009),
]


def test_what_is_set_is_kept_there_and_read_back(cli, smsd, at):
    for name, value, place in SETTINGS:
        answer = cli.json("set", *at, name, value)
        assert (answer["name"], answer["value"]) == (name, int(value, 0))
        assert smsd.words[READ_HOLDING][place] == int(value, 0), name
    cli.json("set", *at, "TARGET_POS", "-2097152")
    assert smsd.value(READ_HOLDING, TARGET_POS) == -2_097_152
    assert cli.json("set", *at, "Relay", "0")["meaning"] == "off"
    assert smsd.bits[READ_COILS][0x1407] is False
    assert smsd.writes() == [
        *[(WRITE_REGISTER, place) for _, _, place in SETTINGS],
        (WRITE_REGISTERS, TARGET_POS),
        (WRITE_COIL, 0x1407),
    ]


@pytest.mark.parametrize(
    "name, value", [("MAX_SPEED", "15"), ("MIN_SPEED", "951"), ("WORK_CURRENT", "81"), ("TARGET_POS", "2097152"), ("SPEED", "1"),
                    ("CMD", "0x10"), ("Soft STOP", "1"), ("MAX_SPED", "100")]
)
def test_what_the_manual_does_not_allow_is_not_sent(cli, smsd, at, name, value):
    cli.fails(1, "set", *at, name, value)
    assert smsd.writes() == []


def test_settings_are_saved_compared_and_applied(cli, smsd, at):
    assert cli.json("settings", "save", "stage.toml", "--lan", *at)["lan"] is True
    assert cli.json("settings", "diff", "stage.toml", *at)["same"] is True
    holding = smsd.words[READ_HOLDING]
    before = dict(holding)
    holding |= {0x1101: 900, 0x110D: 10, 0x110F: 0xFF, 0x7009: 77}
    found = cli.json("settings", "diff", "stage.toml", *at, code=10)["differences"]
    assert [(one["name"], one["controller"]) for one in found] == [
        ("MAX_SPEED", 900), ("WORK_CURRENT", 10), ("Mask", 255), ("lan.ip", "10.1.77.3")
    ]
    assert cli.json("settings", "apply", "stage.toml", *at, "--dry-run")["verified"] is None
    assert smsd.writes() == []
    applied = cli.json("settings", "apply", "stage.toml", *at)
    assert applied["verified"] is True and len(applied["changes"]) == 3
    assert smsd.writes() == [(WRITE_REGISTER, place) for place in (0x1101, 0x110D, 0x110F)]
    assert holding | {0x7009: 2, 0x2104: 0} == before | {word: holding[word] for word in range(0x2100, 0x2104)}
    cli.json("settings", "apply", "stage.toml", "--lan", *at)
    assert holding[0x7009] == 2 and smsd.writes()[-1] == (WRITE_COIL, 0x7400)


def test_settings_that_an_energised_motor_forbids_are_left(cli, smsd, at):
    cli.json("settings", "save", "stage.toml", *at)
    cli.json("stop", *at)
    smsd.words[READ_HOLDING] |= {0x1101: 900, 0x110C: 0}
    smsd.requests.clear()
    done = cli.run("settings", "apply", "stage.toml", *at)
    assert done.returncode == 7 and "MICROSTEPPING" in done.stderr and "nothing was changed" in done.stderr
    assert smsd.writes() == []


def test_a_motor_is_moved_only_from_where_it_is_known_to_be(cli, smsd, at):
    sentence = cli.fails(7, "move", *at, "to", "100steps")
    assert "unknown" in sentence and sentence.endswith("nothing was sent")
    assert cli.json("move", *at, "by", "200 steps", "--dry-run")["to_full_steps"] == -8550.0
    assert smsd.writes() == []
    assert cli.json("move", *at, "by", "200 steps")["position_full_steps"] == -8550.0
    assert smsd.value(READ_INPUT_REGISTERS, ABS_POS) == -68_400
    assert cli.json("zero", *at)["trust"] == "trusted"
    moved = cli.json("move", *at, "to", "-300.5 steps", "--speed", "500 steps/s")
    assert (moved["position_full_steps"], moved["trust"]) == (-300.5, "trusted")
    assert smsd.words[READ_HOLDING][0x1101] == 500
    assert cli.json("stop", *at, "--free")["trust"] == "unknown"
    assert [place for _, place in smsd.writes()].count(CMD) == 2


def test_a_program_is_stored_read_back_started_and_stopped(cli, smsd, at):
    # 40 lines are two blocks.
    (cli.folder / "p.smsd").write_text("SET_MAX_SPEED 100\n" * 39 + "END\n")
    assert cli.json("program", "store", "p.smsd", "--mem", "2", *at)["verified"] is True
    lines = smsd.memories[2]
    # The manual's own example of an instruction.
    assert lines[:39] == [[0x9060, 0x0001]] * 39
    assert smsd.sizes == [0, 0, 40, 0]
    assert cli.run("program", "fetch", "--mem", "2", *at).stdout.count("SET_MAX_SPEED 100") == 39
    cli.json("program", "start", "2", *at)
    assert smsd.words[READ_HOLDING][CMD] == 0x31
    assert "a user program runs" in cli.fails(7, "move", *at, "by", "5steps")
    cli.json("program", "stop", *at)
    assert smsd.bits[READ_INPUTS][0x3200] is False


# ---- what a controller refuses


def test_a_wrong_password_is_told_apart_from_a_lock_out_and_nothing_else_is_sent(cli, smsd, at):
    began = time.monotonic()
    sentence = cli.fails(6, "status", *at, "--password-env", "PASSWORD", PASSWORD="0x1234")
    assert "does not accept the password, in either word order; nothing else was sent" in sentence
    assert "1234" not in sentence and time.monotonic() - began > 3
    assert smsd.writes() == []
    # The next one comes within the lock-out that this one has left behind.
    assert cli.json("status", "-a", f"smsd+tcp://{smsd.place}?word_order=low-first")["moving"] is False


def test_a_password_of_ones_own_comes_from_a_file(cli):
    (cli.folder / "secret").write_text("FEDCBA9876543210\n")
    with Smsd(password=0xFEDC_BA98_7654_3210) as smsd:
        assert cli.json("get", "-a", smsd.place, "ACC", "--password-file", "secret")["values"][0]["value"] == 2000


def test_a_unit_that_is_not_there_does_not_answer(cli, smsd):
    sentence = cli.fails(5, "status", "-a", f"smsd+tcp://{smsd.place}?unit=7", *SHORT)
    assert sentence == f"{smsd.place} (unit 7) did not answer within 100ms"


REFUSALS = [
    ("get ACC", READ_HOLDING, 0x1102, ExcCodes.ILLEGAL_FUNCTION, 2, "does not know how to read ACC"),
    ("get ACC", READ_HOLDING, 0x1102, ExcCodes.ILLEGAL_ADDRESS, 2, "does not let one read ACC at HR 1102"),
    ("get ACC", READ_HOLDING, 0x1102, ExcCodes.DEVICE_FAILURE, 2, "failed to read ACC"),
    ("get ACC", READ_HOLDING, 0x1102, ExcCodes.DEVICE_BUSY, 2, "refused to read ACC"),
    ("get ACC", READ_HOLDING, 0x1102, ExcCodes.GATEWAY_NO_RESPONSE, 2, "refused to read ACC: Modbus exception 0B"),
    ("set ACC 900", WRITE_REGISTER, 0x1102, ExcCodes.ILLEGAL_VALUE, 7, "refused ACC 900 as out of range"),
    ("set ACC 900", WRITE_REGISTER, 0x1102, ExcCodes.DEVICE_BUSY, 7, "the motor is turning; stop it first"),
    ("set ACC 900", WRITE_REGISTER, 0x1102, ExcCodes.DEVICE_FAILURE, 2, "failed to write ACC 900"),
    ("set MICROSTEPPING 4", WRITE_REGISTER, 0x110C, ExcCodes.DEVICE_BUSY, 7, "the motor is energised"),
    ("set TARGET_POS 5", WRITE_REGISTERS, TARGET_POS, ExcCodes.ILLEGAL_VALUE, 7, "refused TARGET_POS 5 as out of range"),
    ("set Relay 0", WRITE_COIL, 0x1407, ExcCodes.ILLEGAL_ADDRESS, 2, "does not let one write Relay 0 at DO 1407"),
    ("status", READ_INPUT_REGISTERS, 0x1000, ExcCodes.DEVICE_FAILURE, 2, "failed to read SPEED"),
    ("move by 10steps", READ_INPUTS, 0x3200, ExcCodes.DEVICE_FAILURE, 2, "failed to read PROGRAM_RUN"),
]


@pytest.mark.parametrize("line, function, place, refusal, code, told", REFUSALS, ids=[f"{row[0]} {row[3].name}" for row in REFUSALS])
def test_an_exception_is_told_by_register(cli, smsd, at, line, function, place, refusal, code, told):
    smsd.refusals[function, place] = refusal
    before = dict(smsd.words[READ_HOLDING])
    command, *words = line.split()
    sentence = cli.fails(code, command, *at, *words)
    assert told in sentence and f"exception {refusal:02X}" in sentence, sentence
    assert all(smsd.words[READ_HOLDING][word] == before[word] for word in before if word < 0x2000)


def test_a_controller_that_takes_its_time_is_waited_for_as_long_as_was_said(cli, smsd, at):
    smsd.delays[READ_HOLDING, 0x1101] = 0.3
    assert cli.json("get", *at, "MAX_SPEED", "ACC")["values"][0]["value"] == 1200
    assert cli.fails(5, "get", *at, "MAX_SPEED", *SHORT) == f"{smsd.place} (unit 1) did not answer within 100ms"


def test_a_write_whose_reply_does_not_come_is_told_as_open(cli, smsd, at):
    smsd.delays[WRITE_REGISTER, 0x1102] = 0.3
    sentence = cli.fails(5, "set", *at, "ACC", "900", *SHORT)
    assert "did not answer within 100ms" in sentence and "whether ACC 900 was written is not known" in sentence


# ---- peers that speak badly


def hang_up(*_):
    raise Hangup


def half_and_hang_up(transaction, unit, pdu):
    raise Hangup(frame(transaction, unit, reply_to(pdu))[:8])


def another(transaction: int) -> int:
    return transaction + 1 & 0xFFFF


BAD = {
    "another transaction": (lambda t, u, pdu: frame(another(t), u, reply_to(pdu)), "did not answer within 100ms"),
    "another unit": (lambda t, u, pdu: frame(t, u + 1, reply_to(pdu)), "did not answer within 100ms"),
    "nothing": (lambda *_: b"", "did not answer within 100ms"),
    "half a frame": (lambda t, u, pdu: frame(t, u, reply_to(pdu))[:8], "did not answer within 100ms"),
    "a flood": (lambda t, u, pdu: frame(another(t), u, reply_to(pdu)) * 3000, "did not answer within 100ms"),
    "an end": (hang_up, "was lost: the other end closed it"),
    "half a frame and an end": (half_and_hang_up, "was lost: the other end closed it"),
    "a web server": (lambda *_: b"HTTP/1.1 400 Bad Request\r\n\r\n", "what cannot be understood: a frame whose length field is"),
    "ones": (lambda *_: b"\xff" * 300, "what cannot be understood: a frame whose length field is 65535"),
    "zeros": (lambda *_: bytes(300), "what cannot be understood: a frame whose length field is 0"),
    "another function": (lambda t, u, pdu: frame(t, u, bytes([pdu[0] ^ 1]) + reply_to(pdu)[1:]), "the reply is to function"),
    "a byte too few": (lambda t, u, pdu: frame(t, u, reply_to(pdu)[:-1]), "the reply has"),
}


# Some of them let one log in first.
LATER = ("another transaction", "half a frame", "half a frame and an end", "zeros", "another function")


@pytest.mark.parametrize("bad, from_the_first", [(bad, True) for bad in BAD] + [(bad, False) for bad in LATER])
def test_a_peer_that_answers_badly_is_given_up_in_good_time(cli, bad, from_the_first):
    answer, told = BAD[bad]

    def answered(transaction, unit, pdu):
        well = not from_the_first and pdu[0] != READ_HOLDING
        return frame(transaction, unit, reply_to(pdu)) if well else answer(transaction, unit, pdu)

    with Peer(answered) as peer:
        began = time.monotonic()
        sentence = cli.fails(5, "get", "-a", peer.place, "MAX_SPEED", *SHORT)
        assert told in sentence and peer.place in sentence, sentence
        assert time.monotonic() - began < 2
        assert 1 <= peer.connections <= 3


def test_a_reply_that_comes_late_is_never_taken_for_another_s(cli):
    late = {}

    def answered(transaction, unit, pdu):
        if pdu[:3] != b"\x03\x11\x01" or late:
            # What was held back, with a value that must not show, and then what was asked for.
            value = {0x1101: 500, 0x1102: 600}.get(int.from_bytes(pdu[1:3]), 0)
            held = late.pop("frame", b"")
            reply = reply_to(pdu)
            return held + frame(transaction, unit, reply[:2] + value.to_bytes(2) if pdu[0] == READ_HOLDING else reply)
        late["frame"] = frame(transaction, unit, b"\x03\x02\x00\x07")
        late["held"] = True
        return b""

    with Peer(answered) as peer:
        values = cli.json("get", "-a", peer.place, "MAX_SPEED", "ACC", *SHORT)["values"]
        assert [reading["value"] for reading in values] == [500, 600]
        assert "frame" not in late


def test_a_command_whose_reply_is_lost_is_not_sent_again(cli):
    def answered(transaction, unit, pdu):
        if pdu[:3] == b"\x06\x11\x09":
            raise Hangup
        status = bytes([4, 12]) + bytes(9) + b"\x03" + bytes(2)
        return frame(transaction, unit, status if pdu[:3] == b"\x04\x10\x00" else reply_to(pdu))

    with Peer(answered) as peer:
        sentence = cli.fails(5, "move", "-a", peer.place, "by", "10steps", *SHORT)
        assert "MOVE_F was sent, but its reply was lost" in sentence and "it was not sent again" in sentence
        assert [pdu for pdu in peer.requests if pdu[:3] == b"\x06\x11\x09"] == [b"\x06\x11\x09\x00\x10"]
        assert peer.connections == 2


def test_a_port_on_which_nobody_listens_is_told_at_once(cli):
    with Peer(hang_up) as peer:
        place = peer.place
    sentence = cli.fails(5, "status", "-a", place)
    assert sentence.startswith(f"cannot connect to {place}: ")


def test_a_peer_that_lets_no_password_be_entered_is_no_smsd(cli):
    with Peer(lambda t, u, pdu: frame(t, u, bytes([pdu[0] | 0x80, 1]))) as peer:
        sentence = cli.fails(2, "get", "-a", peer.place, "ACC")
        assert "does not let a password be entered" in sentence and "is it an SMSD" in sentence


# ---- an SMD3


@pytest.fixture
def smd3():
    with Smd3() as smd3:
        yield smd3


def test_the_status_of_an_smd3(cli, smd3):
    status = cli.json("status", "-a", smd3.path)
    assert status["controller"] == "SMD3, serial number 30128-017, firmware 20168.1"
    assert (status["position_full_steps"], status["moving"], status["faults"]) == (1234.5, False, [])
    assert set(smd3.asked()) <= READINGS.keys(), "it only reads"


# The manual's examples of settings, word for word. Its second for MODE says "1 (Remote)".
TRANSCRIPTS = [
    ("IDENT", "1", "IDENT,1", "0x0000,0x0000,1"),
    ("IDENT", None, "IDENT", "0x0000,0x0000,1"),
    ("MODE", "2", "MODE,2", "0x0000,0x0000,2 (Remote)"),
    ("MODE", None, "MODE", "0x0000,0x0000,1 (Remote)"),
    ("JSMODE", "1", "JSMODE,1", "0x0000,0x0000,1"),
    ("JSMODE", None, "JSMODE", "0x0000,0x0000,1"),
    ("AUTOJS", "1", "AUTOJS,1", "0x0000,0x0000,1"),
    ("AUTOJS", None, "AUTOJS", "0x0000,0x0000,1"),
    ("EXTEN", "1", "EXTEN,1", "0x0000,0x0000,1"),
    ("EXTEN", None, "EXTEN", "0x0000,0x0000,1"),
]


@pytest.mark.parametrize("name, value, sent, answered", TRANSCRIPTS, ids=[row[2] for row in TRANSCRIPTS])
def test_the_manual_s_transcripts(cli, name, value, sent, answered):
    with Smd3({sent: answered.encode() + b"\r\n"}) as smd3:
        if value is None:
            (reading,) = cli.json("get", "-a", smd3.path, name)["values"]
        else:
            reading = cli.json("set", "-a", smd3.path, name, value)
        assert int(reading["value"]) == int(answered.split(",")[2].split()[0])
        assert smd3.asked() == [sent]


def test_every_value_of_the_quick_reference_reads_as_what_the_drive_says(cli, smd3):
    values = cli.json("get", "-a", smd3.path, *READINGS)["values"]
    for (name, said), found in zip(READINGS.items(), values, strict=True):
        value = said if name in ("SER", "FW") else float(said.split()[0])
        assert (found["name"], found["value"]) == (name, value)


def test_what_the_drive_makes_of_a_value_is_what_is_shown(cli, smd3):
    with Smd3({"VMAX,100.2": b"0x0040,0x0000,1.00199E+02\r\n"}) as rounding:
        assert cli.json("set", "-a", rounding.path, "VMAX", "100.2")["value"] == 100.199
    assert cli.json("set", "-a", smd3.path, "l+", "0")["value"] is False
    assert cli.json("set", "-a", smd3.path, "PACT", "-7.5")["value"] == -7.5
    assert smd3.asked() == ["L+,0", "PACT,-7.5"]


@pytest.mark.parametrize("words", [("TMOT", "1"), ("MODE", "6"), ("RUNA", "5"), ("CLR", "1"), ("VMAX", "nan"), ("VMAXX", "1")])
def test_what_the_quick_reference_does_not_allow_is_not_sent(cli, smd3, words):
    cli.fails(1, "set", "-a", smd3.path, *words)
    assert smd3.asked() == []


def test_an_smd3_is_moved_and_waited_for(cli, smd3):
    on = ["-a", smd3.path]
    assert "unknown" in cli.fails(7, "move", *on, "to", "100steps")
    # The manual's RUNR answers a 1 besides the flags.
    assert cli.json("move", *on, "by", "200 steps")["position_full_steps"] == 1434.5
    assert cli.json("zero", *on)["trust"] == "trusted"
    assert cli.json("move", *on, "to", "-1000 steps")["position_full_steps"] == -1000.0
    assert cli.json("move", *on, "to", "5steps", "--no-wait")["expected_s"] > 0
    assert cli.json("stop", *on)["moving"] is False
    cli.run("run", *on, "+")
    assert cli.json("status", *on)["moving"] is True
    starts = [line for line in smd3.asked() if line.startswith("RUN")]
    assert starts == ["RUNR,200", "RUNA,-1000", "RUNA,5", "RUNV,+"]


def test_flags_are_shown_and_faults_cleared(cli, smd3):
    on = ["-a", smd3.path]
    cli.json("stop", *on, "--hard")
    assert smd3.errors == EMERGENCY_STOP
    flags = cli.json("flags", *on)["flags"]
    assert [flag["name"] for flag in flags if flag["set"]] == ["STANDBY", "EMERGENCY STOP"]
    assert len(flags) == 8 + 7
    assert "EMERGENCY STOP" in cli.fails(8, "move", *on, "by", "5steps")
    assert cli.json("clear", *on)["cleared"] == ["EMERGENCY STOP"]
    assert smd3.errors == 0
    assert not [line for line in smd3.asked() if line.startswith("RUN")]


def test_a_fault_that_does_not_clear_is_told(cli):
    stuck = b"0x0040,0x0002\r\n"
    with Smd3({"CLR": stuck}) as smd3:
        smd3.errors = 2
        assert "TOPEN" in cli.fails(8, "clear", "-a", smd3.path)


def test_settings_of_an_smd3_are_saved_compared_and_applied(cli, smd3):
    on = ["-a", smd3.path]
    assert cli.json("settings", "save", "uhv.toml", *on)["settings"] > 20
    # This drive keeps what it is given, and does not round as ours does.
    assert cli.json("settings", "diff", "uhv.toml", *on)["same"] is True
    smd3.values |= {"VMAX": "1.00000E+02", "L-": "1"}
    smd3.lines.clear()
    applied = cli.json("settings", "apply", "uhv.toml", *on)
    assert applied["verified"] is True
    assert [line for line in smd3.asked() if "," in line] == ["L-,0", "VMAX,250.0"]


ERRORS = [
    ("-1 (Stop motor first)", 7),
    ("-2 (Argument validation)", 1),
    ("-5 (Action failed)", 2),
    ("-6 (Not possible in mode)", 7),
    ("-7 (Not possible when motor disabled)", 8),
]


@pytest.mark.parametrize("error, code", ERRORS)
def test_an_error_of_the_drive_is_told_with_its_text(cli, error, code):
    with Smd3({"RES": f"0x0040,0x0020,{error}\r\n".encode()}) as smd3:
        number, text = error.split(" ", 1)
        sentence = cli.fails(code, "set", "-a", smd3.path, "RES", "64")
        assert sentence.startswith(f"RES,64 refused ({number}, {text[1:-1]}): ")
        assert smd3.lines.count("RES,64") == 1


VMAX = b"0x0040,0x0000,2.50000E+02\r\n"
TROUBLE = {
    "silence": ({"VMAX": None}, "did not answer within 100ms"),
    "silence from the first": ({"*": None}, "did not answer within 100ms"),
    "half a line": ({"VMAX": VMAX[:20]}, "did not answer within 100ms"),
    "garbage": ({"VMAX": b"\xff\xfe\x00\x1b[2Jgarbage\r\n"}, "what cannot be understood"),
    "garbage from the first": ({"*": b"login: \r\n"}, "what cannot be understood"),
    "no value": ({"VMAX": b"0x0040,0x0000\r\n"}, "lacks a value of type FLOAT"),
    "another value": ({"VMAX": b"0x0040,0x0000,fast\r\n"}, "is not of type FLOAT"),
    "one set of flags": ({"VMAX": b"0x0040\r\n"}, "does not begin with two sets of flags"),
    "an unknown error": ({"VMAX": b"0x0040,0x0000,-99 (Cold)\r\n"}, "an error of unknown number, -99"),
    "no end": ({"VMAX": b"x" * 3000}, "without an end"),
    "many lines": ({"VMAX": b"x\r\n" * 900}, "what cannot be understood"),
    "unplugged": ({"VMAX": UNPLUG}, "cannot connect to "),
    "unplugged from the first": ({"*": UNPLUG}, "cannot connect to "),
}


@pytest.mark.parametrize("trouble", TROUBLE)
def test_a_drive_that_answers_badly_is_given_up_in_good_time(cli, trouble):
    script, told = TROUBLE[trouble]
    with Smd3(script) as smd3:
        began = time.monotonic()
        sentence = cli.fails(5, "get", "-a", smd3.path, "VMAX", *SHORT)
        assert told in sentence and smd3.path in sentence and sentence.isprintable(), sentence
        assert time.monotonic() - began < 2
        assert smd3.lines.count("VMAX") <= 3


@pytest.mark.parametrize(
    "bad", [None, VMAX[:-9], VMAX[:-1], b"\x00\xff\r\n", b"noise\r\nnoise\r\n", b"0x0040,0x0000,9"],
    ids=["lost", "cut off", "without its end", "garbage", "two lines", "half a value"],
)
def test_a_reply_that_is_spoilt_once_does_not_spoil_the_next(cli, bad):
    with Smd3({"VMAX": [bad, VMAX]}) as smd3:
        values = cli.json("get", "-a", smd3.path, "VMAX", "TMOT", *SHORT)["values"]
        assert [reading["value"] for reading in values] == [250.0, 23.14]


@pytest.mark.parametrize("answer", ["-4 (Unknown command)", "-2 (Argument validation)", "-102 (Argument count)", None])
def test_whatever_a_drive_says_to_a_line_that_is_no_command_it_is_understood(cli, answer):
    said = "0x0040,0x0000" + (f",{answer}" if answer else "")
    with Smd3({",?": said.encode() + b"\r\n"}) as smd3:
        assert cli.json("get", "-a", smd3.path, "VMAX")["values"][0]["value"] == 250.0


@pytest.mark.parametrize("trouble", [None, b"0x00", UNPLUG], ids=["silence", "half a line", "unplugged"])
def test_a_motion_whose_reply_is_lost_is_not_started_again(cli, trouble):
    with Smd3({"RUNR": trouble}) as smd3:
        sentence = cli.fails(5, "move", "-a", smd3.path, "by", "-10 steps", *SHORT)
        assert sentence.startswith("RUNR,-10 was sent, but its reply was lost (") and "it was not sent again: " in sentence
        assert smd3.lines.count("RUNR,-10") == 1
        after = "its state could not be read afterwards" if trouble is UNPLUG else "the motor is in standby at PACT 1234.5"
        assert after in sentence


@pytest.mark.parametrize("path", ["/dev/pts/99999", "/dev/null"])
def test_a_port_that_is_none_is_told_at_once(cli, path):
    assert cli.fails(5, "status", "-a", path).startswith(f"cannot connect to {path}: ")
