"""The byte vectors that are known of the SMSD's standard protocol: what the client of these tests makes of them, and what a
controller answers to each. So neither end is right by the other's mistake."""

import re
from pathlib import Path

import pytest

from smsd_usb import *


def instruction(code: int, data: int = 0) -> bytes:
    return word(code, data).to_bytes(4, "little")


# A packet's bytes, and what it is: version, type, identification, data.
PACKETS = {
    # The maker's own software was seen to send these.
    "10 02 10 DE 00 00": (2, VERSION_GET, 0xDE, b""),
    "D6 02 02 02 04 00 20 00 00 00": (2, POWERSTEP01, 2, instruction(STATUS_IN_EVENT)),
    "BC 02 02 D9 04 00 60 03 00 00": (2, POWERSTEP01, 0xD9, instruction(GET_MIN_SPEED)),
    "F3 02 0C FF 00 00": (2, CONFIG_GET, 0xFF, b""),
    "F1 02 0E FF 00 00": (2, ERROR_GET, 0xFF, b""),
    "B8 01 00 7F 08 00 01 23 45 67 89 AB CD EF": (1, REQUEST, 0x7F, PASSWORD[::-1]),
    # These were computed.
    "37 02 00 FF 08 00 EF CD AB 89 67 45 23 01": (2, REQUEST, 0xFF, PASSWORD),
    "FE 02 00 00 00 00": (2, REQUEST, 0, b""),
    "06 02 02 01 04 00 60 90 01 00": (2, POWERSTEP01, 1, instruction(SET_MAX_SPEED, 100)),
    "27 02 02 05 04 00 30 F4 A8 00": (2, POWERSTEP01, 5, instruction(SET_MODE, 10813)),
    "F2 02 01 00 07 00 03 00 01 00 00 00 00": (2, RESPONSE, 0, bytes([HI_Z | READY, 0, OK_ACCESS, 0, 0, 0, 0])),
    "FA 02 02 03 04 00 00 FD FF FF": (2, POWERSTEP01, 3, instruction(MOVE_F, -1)),
    "2A 02 02 FE 04 00 D0 00 00 00": (2, POWERSTEP01, 0xFE, instruction(GET_STATUS_AND_CLR)),
}

# The same between start and stop.
STUFFED = {
    "2A 02 02 FE 04 00 D0 00 00 00": "FA 2A 02 02 FE 7E 04 00 D0 00 00 00 FB",
    "FA 02 02 03 04 00 00 FD FF FF": "FA FE 7A 02 02 03 04 00 00 FD FF FF FB",
    "10 02 10 DE 00 00": "FA 10 02 10 DE 00 00 FB",
}

INSTRUCTIONS = {
    "10 00 00 00": (GET_SPEED, 0),
    "00 01 00 00": (MOVE_F, 0),
    "00 02 00 00": (HARD_STOP, 0),
    "60 FC 03 00": (SET_MAX_SPEED, 255),
    "20 01 FC 03": (GO_TO_F, 0xFF00),
    "C0 01 00 80": (GO_TO, -2097152),
    "60 90 01 00": (SET_MAX_SPEED, 100),
}

# What a controller that has just been logged in to answers, in this order: type, code of the status structure if it is one.
ANSWERS = {
    "10 02 10 DE 00 00": (VERSION_GET, None),
    "D6 02 02 02 04 00 20 00 00 00": (POWERSTEP01, GOT_STATUS_IN_EVENT),
    "BC 02 02 D9 04 00 60 03 00 00": (POWERSTEP01, GOT_MIN_SPEED),
    "F3 02 0C FF 00 00": (CONFIG_GET, None),
    "F1 02 0E FF 00 00": (ERROR_GET, None),
    "06 02 02 01 04 00 60 90 01 00": (POWERSTEP01, OK),
    "27 02 02 05 04 00 30 F4 A8 00": (POWERSTEP01, OK),
    "FA 02 02 03 04 00 00 FD FF FF": (POWERSTEP01, OK),
    "2A 02 02 FE 04 00 D0 00 00 00": (POWERSTEP01, OK),
}


@pytest.mark.parametrize(("text", "meaning"), PACKETS.items())
def test_the_client_makes_and_reads_every_packet(text, meaning):
    raw = bytes.fromhex(text)
    version, kind, ident, data = meaning
    assert packet(kind, data, ident, version) == raw
    assert Packet.parse(raw) == meaning
    assert unstuffed(stuffed(raw)) == raw
    assert stuffed(raw) == bytes.fromhex(STUFFED.get(text, f"FA {text.replace('FE', 'FE 7E')} FB"))


@pytest.mark.parametrize(("text", "meaning"), INSTRUCTIONS.items())
def test_the_client_makes_every_instruction(text, meaning):
    assert instruction(*meaning) == bytes.fromhex(text)


@pytest.mark.parametrize(("transport", "password"), [
    ("usb", "B8 01 00 7F 08 00 01 23 45 67 89 AB CD EF"),
    ("usb_tcp", "37 02 00 FF 08 00 EF CD AB 89 67 45 23 01"),
    ("standard_tcp", "37 02 00 FF 08 00 EF CD AB 89 67 45 23 01"),
])
def test_a_controller_answers_every_packet(tmp_path, transport, password):
    ports = USB_AND_STANDARD if transport == "standard_tcp" else USB_AND_MODBUS
    with UsbRig(tmp_path, ports=ports) as rig:
        smsd = rig.open(transport)
        rig.pass_time("1s")
        smsd.line.send(bytes.fromhex(password))
        # De-energised, ready; and the direction after power-up.
        answer = Answer.of(smsd.receive())
        assert answer == (RESPONSE, bytes.fromhex(password)[3], HI_Z | READY | FORWARD, OK_ACCESS, 0)
        for text, (kind, code) in ANSWERS.items():
            raw = bytes.fromhex(text)
            smsd.line.send(raw)
            reply = smsd.receive()
            assert (reply.kind, reply.ident) == (kind, raw[3]), text
            assert code is None or Answer.of(reply).code == code, text
        rig.run()
        assert (smsd.do(GET_MAX_SPEED), smsd.do(GET_MODE), smsd.position()) == (100, 10813, -1)


PAGE = Path(__file__).parents[2] / "docs/smsd-usb.md"


def test_the_session_that_is_printed_goes_as_printed(tmp_path):
    said = re.findall(r"^([<>]) ((?:[0-9A-F]{2} )*FB)(?: |$)", PAGE.read_text(), re.MULTILINE)
    assert len(said) >= 20 and [who for who, _ in said] == [">", "<"] * (len(said) // 2)
    with UsbRig(tmp_path) as rig:
        line = rig.open().line
        for (_, request), (_, reply) in zip(said[::2], said[1::2], strict=True):
            line.write(bytes.fromhex(request))
            assert line.port.read_until(bytes([STOP])).hex(" ").upper() == reply, request
            rig.pass_time("1s")
