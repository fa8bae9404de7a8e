"""What no sound client sends to an SMSD's USB port, and clients that are not sound. The rig's clock is paused.

After each of them the next good packet is answered, and the controller is as it was.
"""

import random
import time

import pytest

from smsd_usb import *

IDENT = 0xA5
# Asked for behind what is bad; its reply is known by its identification.
POSITION = stuffed(packet(POWERSTEP01, word(GET_ABS_POS).to_bytes(4, "little"), IDENT))
# Would be seen if it were carried out.
RUN = packet(POWERSTEP01, word(RUN_F, 100).to_bytes(4, "little"), 0x42)


@pytest.fixture
def rig(tmp_path):
    with UsbRig(tmp_path) as rig:
        yield rig


@pytest.fixture(params=["usb", "usb_tcp"])
def usb(rig, request):
    """A connection that is logged in, to a controller that is not as it leaves the factory."""
    usb = rig.logged_in(request.param)
    usb.do(SET_MAX_SPEED, 600)
    usb.do(MOVE_R, 160)
    rig.run()
    usb.do(SET_RELE)
    assert usb.write_memory(1, [word(MOVE_F, -1), word(SET_WAIT, 62)]) == OK
    return usb


@pytest.fixture
def harm(usb):
    """Sends bytes and a good packet behind them, and gives back the answers in between."""
    before = usb.state()

    def send(data: bytes) -> list[Answer]:
        usb.line.write(data + POSITION)
        answers = []
        while (reply := usb.receive()).ident != IDENT:
            answers.append(Answer.of(reply))
            assert answers[-1].kind == RESPONSE and answers[-1].data == 0
        good = Answer.of(reply)
        assert (good.kind, good.code, good.data) == (POWERSTEP01, GOT_ABS_POS, 0xFFFFFFFF - 159)
        return answers

    yield send
    assert usb.line.is_silent()
    assert usb.state() == before


def outcome(answers: list[Answer]) -> list[tuple[int, int]]:
    """Identification and code of each."""
    return [(answer.ident, answer.code) for answer in answers]


def test_any_single_wrong_bit_is_found(harm):
    for place in range(len(RUN)):
        for bit in range(8):
            wrong = bytearray(RUN)
            wrong[place] ^= 1 << bit
            assert outcome(harm(stuffed(bytes(wrong)))) == [(wrong[3], ERROR_XOR)], wrong.hex(" ")


def test_packets_that_are_too_short(harm):
    assert outcome(harm(bytes([START, STOP]))) == [(0, ERROR_LEN)]
    for length in range(1, 6):
        ident = RUN[3] if length > 3 else 0
        assert outcome(harm(stuffed(RUN[:length]))) == [(ident, ERROR_LEN)], length


def test_a_length_that_is_not_that_of_the_data(harm):
    line = RUN[6:]
    for length in [0, 3, 5, 255, 256, 1024, 1025, 0xFAFB, 0xFFFF]:
        assert outcome(harm(stuffed(packet(POWERSTEP01, line, 0x42, length=length)))) == [(0x42, ERROR_LEN)], length
    assert outcome(harm(stuffed(packet(W_MEM0, bytes(1025), 7)))) == [(7, ERROR_LEN)]
    assert outcome(harm(stuffed(packet(W_MEM0, bytes(1024), 7, length=1025)))) == [(7, ERROR_LEN)]


def test_types_that_there_are_not(harm):
    for kind in [RESPONSE, 15, *range(17, 256)]:
        for data in (b"", RUN[6:]):
            assert outcome(harm(stuffed(packet(kind, data, 3)))) == [(3, ERROR_NO_COMMAND)], kind


def test_data_of_a_length_that_the_type_does_not_have(harm):
    lengths = {
        REQUEST: [0, 7, 9], POWERSTEP01: [0, 1, 2, 3, 5, 8], W_MEM0 + 1: [1, 2, 3, 5, 1019, 1021, 1024], R_MEM0 + 1: [1, 4],
        CONFIG_SET: [0, 24, 25, 27], CONFIG_GET: [1, 26], PASSWORD_SET: [0, 7, 9], ERROR_GET: [1, 68], VERSION_GET: [1, 9],
    }
    for kind, wrong in lengths.items():
        for length in wrong:
            assert outcome(harm(stuffed(packet(kind, bytes(length), 3)))) == [(3, ERROR_LEN)], (kind, length)


def test_instructions_that_there_are_not_and_data_out_of_range(harm):
    for line, code in [
        (0x3F << 4, ERROR_NO_COMMAND), (word(RUN_F, 100) | 1, ERROR_RANGE), (word(RUN_F, 100) | 8, ERROR_RANGE),
        (word(RUN_F, 14), ERROR_RANGE), (word(SET_MAX_SPEED, 15), ERROR_RANGE), (word(GO_UNTIL_F, 8), ERROR_RANGE),
        (0xFFFFFFFF, None),
    ]:
        ((ident, answered),) = outcome(harm(stuffed(packet(POWERSTEP01, line.to_bytes(4, "little"), 3))))
        assert ident == 3 and answered == (code or answered) and answered in (ERROR_NO_COMMAND, ERROR_RANGE)


def test_endless_packets_are_answered_once(harm):
    for length in (1031, 1500, 20_000):
        ((_, code),) = outcome(harm(bytes([START]) + bytes(length) + bytes([STOP])))
        assert code == ERROR_LEN
    assert outcome(harm(bytes([START]) + RUN + bytes(20_000))) == [], "without its end it is not answered"
    assert outcome(harm(stuffed(bytes([ESCAPE]) * 1030))) == [(ESCAPE, ERROR_XOR)], "as long as the longest"
    assert outcome(harm(stuffed(bytes([ESCAPE]) * 1031))) == [(ESCAPE, ERROR_LEN)]


def test_starts_and_stops_that_are_missing_or_too_many(harm):
    begin, end = bytes([START]), bytes([STOP])
    harmless = packet(CONFIG_GET, b"1", 5)
    answer = [(5, ERROR_LEN)]
    assert outcome(harm(harmless + end)) == [], "no start"
    assert outcome(harm(begin + harmless)) == [], "no stop"
    assert outcome(harm(begin + RUN[:7])) == [], "half a packet"
    assert outcome(harm(begin * 5 + harmless + end)) == answer
    assert outcome(harm(begin + harmless + end * 5)) == answer
    assert outcome(harm(begin + RUN[:7] + begin + harmless + end)) == answer, "one in another"
    assert outcome(harm(begin + RUN + begin + harmless + end + RUN[3:] + end)) == answer
    assert outcome(harm((begin + end) * 3)) == [(0, ERROR_LEN)] * 3


def test_escapes_that_are_none(harm):
    whole = packet(CONFIG_GET, b"", 5)
    for inside in [whole + bytes([ESCAPE]), whole + bytes([0, ESCAPE]), whole[:-1] + bytes([ESCAPE, 0x00])]:
        assert outcome(harm(bytes([START]) + inside + bytes([STOP]))) == [(5, ERROR_XOR)], inside.hex(" ")
    for second in set(range(256)) - {0x7A, 0x7B, 0x7E, START, STOP}:
        inside = whole + bytes([ESCAPE, second])
        assert outcome(harm(bytes([START]) + inside + bytes([STOP]))) == [(5, ERROR_XOR)], second
    assert outcome(harm(bytes([START]) + RUN[:5] + bytes([ESCAPE]))) == [], "the next start is one all the same"
    assert outcome(harm(bytes([START, ESCAPE, STOP]))) == [(0, ERROR_LEN)]


def test_bytes_between_packets_are_skipped(harm):
    assert outcome(harm(bytes(set(range(256)) - {START}))) == []
    assert outcome(harm(bytes([ESCAPE]))) == []
    assert outcome(harm(bytes([ESCAPE, STOP, STOP, ESCAPE]) + b"AT\r\n" + RUN)) == []
    assert outcome(harm(bytes(100_000))) == []


def test_a_client_that_does_not_stuff_is_refused_where_it_matters(harm):
    unstuffed_move = packet(POWERSTEP01, word(MOVE_F, -1).to_bytes(4, "little"), 3)
    assert unstuffed_move[0] == START, "its checksum"
    assert outcome(harm(bytes([START]) + unstuffed_move + bytes([STOP]))) == [(4, ERROR_XOR)]


def test_a_client_that_stuffs_its_escapes_again_is_refused(harm):
    move = packet(POWERSTEP01, word(MOVE_F, -1).to_bytes(4, "little"), 3)
    twice = move.replace(b"\xfa", b"\xfe\x7a").replace(b"\xfb", b"\xfe\x7b").replace(b"\xfe", b"\xfe\x7e")
    assert [code for _, code in outcome(harm(bytes([START]) + twice + bytes([STOP])))] == [ERROR_XOR]


def test_noise_never_hides_the_next_packet(harm):
    noise = random.Random(7)
    special = [START, STOP, ESCAPE, 0x7A, 0x7B, 0x7E, 0x02, 0x00]
    for _ in range(400):
        length = noise.randrange(60)
        harm(bytes(noise.choice([noise.choice(special), noise.randrange(256)]) for _ in range(length)))


def test_errors_of_packets_are_answered_before_the_log_in_too(rig):
    usb = rig.open()
    for data, expected in [
        (bytes([START, STOP]), (0, ERROR_LEN)), (stuffed(RUN[:3]), (0, ERROR_LEN)), (stuffed(b"\0" + RUN[1:]), (0x42, ERROR_XOR)),
        (stuffed(packet(REQUEST, PASSWORD, 3, length=7)), (3, ERROR_LEN)),
        (stuffed(packet(99, b"", 3)), (3, ERROR_ACCESS)), (stuffed(packet(REQUEST, b"", 3)), (3, ERROR_LEN)),
    ]:
        usb.line.write(data)
        answer = Answer.of(usb.receive())
        assert (answer.ident, answer.code, answer.kind) == (*expected, RESPONSE), data.hex(" ")


def test_an_empty_packet_tells_the_version(rig):
    usb = rig.open()
    usb.line.write(bytes([START, STOP]))
    assert usb.line.receive()[1] == 2


# Time


def test_a_packet_may_come_byte_by_byte(usb):
    for number in range(3):
        for place in range(len(POSITION)):
            usb.line.write(POSITION[place : place + 1])
            time.sleep(0.02 if number == 0 else 0)
        reply = usb.receive()
        assert (reply.ident, Answer.of(reply).code) == (IDENT, GOT_ABS_POS)
    assert usb.line.is_silent()


def test_packets_cut_anywhere_are_put_together(usb):
    for place in range(1, 2 * len(POSITION)):
        usb.line.write((POSITION * 2)[:place])
        time.sleep(0.002)
        usb.line.write((POSITION * 2)[place:])
        assert [usb.receive().ident for _ in range(2)] == [IDENT, IDENT]
    assert usb.line.is_silent()


def test_half_a_packet_is_dropped_after_its_time(usb):
    for place in range(1, len(POSITION) - 1, 3):
        usb.line.write(POSITION[:place])
        assert usb.line.is_silent(HALF_PACKET_SECONDS + 0.2)
        usb.line.write(POSITION[place:])
        assert usb.line.is_silent(), "what comes later is no packet"
        assert usb.position() == -160


def test_a_packet_lives_as_long_as_its_bytes_keep_coming(usb):
    for byte in POSITION[:4]:
        usb.line.write(bytes([byte]))
        time.sleep(HALF_PACKET_SECONDS / 2)
    usb.line.write(POSITION[4:])
    assert usb.receive().ident == IDENT
    assert "TIME_OUT" not in usb.counters()


def test_packets_may_be_sent_without_waiting(usb):
    lines = [packet(POWERSTEP01, word(SET_MAX_SPEED, 100 + ident).to_bytes(4, "little"), ident) for ident in range(256)]
    reads = [packet(POWERSTEP01, word(GET_MAX_SPEED).to_bytes(4, "little"), ident) for ident in range(256)]
    usb.line.write(b"".join(stuffed(line) + stuffed(read) for line, read in zip(lines, reads)))
    for ident in range(256):
        assert usb.receive().ident == ident
        answer = Answer.of(usb.receive())
        assert (answer.ident, answer.data) == (ident, 100 + ident)
    assert usb.line.is_silent()
