"""An SMSD with the standard firmware: the same packets over TCP, as they are. The rig's clock is paused."""

import struct
import time

import pytest

from smsd_usb import *

IDENT = 0xA5
POSITION = packet(POWERSTEP01, word(GET_ABS_POS).to_bytes(4, "little"), IDENT)


@pytest.fixture
def rig(tmp_path):
    with UsbRig(tmp_path, ports=USB_AND_STANDARD) as rig:
        assert "modbus_tcp" not in rig.drive
        yield rig


@pytest.fixture
def lan(rig):
    return rig.logged_in("standard_tcp")


def test_the_controller_speaks_first(rig):
    line = Raw(rig.drive["standard_tcp"])
    assert line.receive() == bytes.fromhex("FE0200000000")
    line.close()
    assert rig.open("usb").line.is_silent(), "at its USB port it does not"


def test_a_session_over_tcp(rig):
    lan = rig.open("standard_tcp")
    assert lan.refusal(GET_ABS_POS) == ERROR_ACCESS
    assert lan.try_password(PASSWORD) == ERROR_ACCESS_TIMEOUT
    rig.pass_time("1s")
    assert lan.try_password(PASSWORD) == OK_ACCESS
    assert lan.versions() == (6, 1, 1, 3, 2)
    lan.do(SET_MAX_SPEED, 2000)
    lan.do(MOVE_R, 5000)
    rig.run()
    assert lan.do(GET_ABS_POS) == 0xFFFFFFFF - 4999
    program = [word(GO_TO, number * -1000) for number in range(LINES)]
    assert lan.write_memory(3, program) == OK
    assert lan.read_memory(3) == program
    lan.do(SET_RELE)
    usb = rig.logged_in("usb")
    assert usb.relay_is_on() and usb.position() == -5000 and usb.read_memory(3) == program


def test_connections_are_sessions_of_their_own_and_eight_of_them(rig, lan):
    others = [rig.open("standard_tcp") for _ in range(7)]
    assert [other.refusal(GET_ABS_POS) for other in others] == [ERROR_ACCESS] * 7
    ninth = Raw(rig.drive["standard_tcp"])
    assert ninth.is_closed()
    assert lan.counters()["SOCKET"] == 1
    others[0].close()
    time.sleep(0.1)
    rig.open("standard_tcp")


def test_a_log_in_ends_with_the_connection(rig, lan):
    lan.close()
    assert rig.open("standard_tcp").refusal(GET_ABS_POS) == ERROR_ACCESS


def test_the_lan_parameters_have_no_unit_identifier(rig, lan):
    port = int(rig.drive["standard_tcp"].rsplit(":", 1)[1])
    assert lan.lan() == FACTORY_LAN._replace(port=port, ident=None)
    assert lan.code(CONFIG_SET, lan.lan().pack() + b"\1") == ERROR_LEN
    usb = rig.logged_in("usb")
    wanted = lan.lan()._replace(port=free_port(), ip=b"\x0a\xfa\xfb\xfe", dhcp=2)
    assert usb.set_lan(wanted) == OK
    assert usb.lan() == wanted, "the USB port goes on"
    assert lan.line.is_closed()
    wait_listening(wanted.port)
    moved = Smsd(Raw(f"127.0.0.1:{wanted.port}"))
    rig.pass_time("1s")
    assert moved.try_password(PASSWORD) == OK_ACCESS
    assert moved.lan() == wanted
    for wrong in [{"port": 0}, {"dhcp": 0}, {"dhcp": 3}]:
        assert moved.set_lan(wanted._replace(**wrong)) == ERROR_RANGE
    back = wanted._replace(port=port)
    assert moved.set_lan(back) == OK, "the reply comes before it takes effect"
    assert moved.line.is_closed()
    moved.close()
    assert usb.lan() == back


def test_stop_usb_stops_nothing_here(rig, lan):
    lan.do(STOP_USB)
    assert lan.position() == 0
    usb = rig.logged_in("usb")
    assert usb.position() == 0


def test_a_controller_of_version_1_says_so_first(tmp_path):
    with UsbRig(tmp_path, ports=USB_AND_STANDARD + "protocol_version = 1\n") as rig:
        line = Raw(rig.drive["standard_tcp"])
        assert line.receive() == bytes.fromhex("FF0100000000")
        line.close()
        lan = rig.logged_in("standard_tcp")
        lan.do(GOTO_PROGRAM_IF_ZERO)
        for code in NEWER:
            assert lan.refusal(code, 100) == ERROR_NO_COMMAND


# Bad input


@pytest.fixture
def harm(rig, lan):
    """Sends bytes and a good packet behind them, and gives back identification and code of the answers in between."""
    before = lan.state()

    def send(data: bytes) -> list[tuple[int, int]]:
        lan.line.write(data + POSITION)
        answers = []
        while (reply := lan.receive()).ident != IDENT:
            answer = Answer.of(reply)
            assert answer.kind == RESPONSE
            answers.append((answer.ident, answer.code))
        assert Answer.of(reply).code == GOT_ABS_POS
        return answers

    yield send
    assert lan.line.is_silent()
    assert lan.state() == before


def test_a_wrong_checksum_costs_one_packet(harm):
    run = packet(POWERSTEP01, word(RUN_F, 100).to_bytes(4, "little"), 3)
    for place in (0, 1, 2, 6, 7, 8, 9):
        wrong = bytearray(run)
        wrong[place] ^= 0x10
        assert harm(bytes(wrong)) == [(3, ERROR_XOR)], place


def test_wrong_types_lengths_and_instructions(harm):
    for wrong, code in [
        (packet(15, b"", 3), ERROR_NO_COMMAND), (packet(255, bytes(1024), 3), ERROR_NO_COMMAND), (packet(1, b"", 3), ERROR_NO_COMMAND),
        (packet(POWERSTEP01, b"123", 3), ERROR_LEN), (packet(REQUEST, b"", 3), ERROR_LEN), (packet(W_MEM0, bytes(1024), 3), ERROR_LEN),
        (packet(POWERSTEP01, struct.pack("<I", 0x3F << 4), 3), ERROR_NO_COMMAND),
        (packet(POWERSTEP01, struct.pack("<I", word(RUN_F, 14)), 3), ERROR_RANGE),
    ]:
        assert harm(wrong) == [(3, code)], wrong.hex(" ")


def test_starts_stops_and_escapes_are_bytes_like_any_other(lan):
    for ident in (START, STOP, ESCAPE):
        assert lan.ask(CONFIG_GET, ident=ident).ident == ident


def test_a_length_that_cannot_be_is_answered_once_and_all_skipped_until_silence(rig, lan):
    before = lan.state()
    for length in (1025, 0xFFFF):
        lan.line.write(packet(POWERSTEP01, POSITION * 20, 3, length=length))
        answer = Answer.of(lan.receive())
        assert (answer.kind, answer.ident, answer.code) == (RESPONSE, 3, ERROR_LEN)
        assert lan.line.is_silent(HALF_PACKET_SECONDS / 2)
        lan.line.write(POSITION)
        assert lan.line.is_silent(HALF_PACKET_SECONDS + 0.2)
        assert lan.state() == before


def test_half_a_packet_is_dropped_after_its_time(lan):
    for number, place in enumerate((1, 4, 6, 9), 1):
        lan.line.write(POSITION[:place])
        assert lan.line.is_silent(HALF_PACKET_SECONDS + 0.2)
        assert lan.position() == 0
        assert lan.counters() == {"TIME_OUT": number}


def test_packets_cut_anywhere_are_put_together(lan):
    for place in range(1, 2 * len(POSITION)):
        lan.line.write((POSITION * 2)[:place])
        time.sleep(0.002)
        lan.line.write((POSITION * 2)[place:])
        assert [lan.receive().ident for _ in range(2)] == [IDENT, IDENT]
    assert lan.line.is_silent()
