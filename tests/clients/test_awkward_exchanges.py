"""Exchanges that the Modbus servers of the field get wrong, over plain sockets."""

import random
import struct
import time

import pytest

from wire import Wire, frame, read, write_one, write_registers

MAX_SPEED, TARGET_POS, CMD, CMD_BUFFER = 0x1101, 0x1106, 0x1109, 0x3100
IDENTIFICATION = read(4, 0x8002, 1)
HW_VER_IS_1 = bytes([4, 2, 0, 1])
CONNECTIONS = 8


@pytest.fixture
def dial(rig):
    """Opens plain connections, and closes them when the test is over."""
    opened = []

    def open_one() -> Wire:
        wire = Wire(rig.port)
        opened.append(wire)
        return wire

    yield open_one
    for wire in opened:
        wire.close()


@pytest.fixture
def wire(dial) -> Wire:
    """A connection that is logged in."""
    wire = dial()
    wire.log_in()
    return wire


def exception(function: int, code: int) -> bytes:
    return bytes([function | 0x80, code])


# Segments


def test_a_request_byte_by_byte(wire):
    for byte in frame(read(3, MAX_SPEED, 1), transaction=0xBEEF):
        wire.send(bytes([byte]))
        time.sleep(0.002)
    assert wire.receive() == (0xBEEF, bytes([3, 2, 0x03, 0xE8]))
    assert wire.is_silent()


def test_three_requests_in_one_segment(wire):
    requests = [read(3, MAX_SPEED, 1), write_one(6, MAX_SPEED, 500), read(3, MAX_SPEED, 1)]
    wire.send(b"".join(frame(pdu, transaction) for transaction, pdu in enumerate(requests, 0xFFFD)))
    assert wire.receive() == (0xFFFD, bytes([3, 2, 0x03, 0xE8]))
    assert wire.receive() == (0xFFFE, requests[1])
    assert wire.receive() == (0xFFFF, bytes([3, 2, 0x01, 0xF4]))


def test_one_request_and_a_half_and_then_the_other_half(wire):
    second = frame(read(3, MAX_SPEED, 1), transaction=8)
    wire.send(frame(read(3, MAX_SPEED + 1, 1), transaction=7) + second[:9])
    assert wire.receive()[0] == 7
    assert wire.is_silent()
    wire.send(second[9:])
    assert wire.receive() == (8, bytes([3, 2, 0x03, 0xE8]))


# Quantities and addresses


def test_a_write_of_123_registers_reaches_no_such_range(wire):
    wire.ask(write_registers(CMD_BUFFER, [0x1234, 0x5678]))
    assert wire.ask(write_registers(CMD_BUFFER, [0xFFFF] * 123)) == exception(0x10, 2)
    assert wire.ask(write_registers(0x1100, [20] * 123)) == exception(0x10, 2)
    assert wire.holding(CMD_BUFFER, 3) == [0x1234, 0x5678, 0]
    assert wire.holding(0x1100, 2) == [0, 1000]


def test_a_read_of_125_registers_reaches_no_such_range(wire):
    assert wire.ask(read(3, CMD_BUFFER, 125)) == exception(3, 2)
    assert len(wire.holding(CMD_BUFFER, 64)) == 64
    assert wire.ask(read(3, CMD_BUFFER, 65)) == exception(3, 2)
    assert wire.ask(read(4, 0x1000, 125)) == exception(4, 2)


def test_quantities_beyond_the_specification(wire):
    for function, address, most in [(1, 0x1400, 2000), (2, 0x1200, 2000), (3, 0x1100, 125), (4, 0x1000, 125)]:
        assert wire.ask(read(function, address, most)) == exception(function, 2)
        for quantity in (0, most + 1, 0xFFFF):
            assert wire.ask(read(function, address, quantity)) == exception(function, 3), quantity
    assert wire.ask(bytes([0x10, 0x11, 0x00, 0, 0, 0])) == exception(0x10, 3)
    assert wire.ask(bytes([0x0F, 0x14, 0x00, 0, 0, 0])) == exception(0x0F, 3)


def test_a_byte_count_that_lies(wire):
    pdu = bytearray(write_registers(MAX_SPEED, [500, 600]))
    for byte_count in (0, 2, 3, 5, 255):
        pdu[5] = byte_count
        assert wire.ask(bytes(pdu)) == exception(0x10, 3), byte_count
    assert wire.ask(bytes([0x0F, 0x14, 0x07, 0, 1, 2, 1, 0])) == exception(0x0F, 3)
    assert wire.holding(MAX_SPEED, 2) == [1000, 1000]


def test_addresses_out_of_range(wire):
    assert wire.ask(read(3, 0xFFFF, 1)) == exception(3, 2)
    assert wire.ask(read(3, 0xFFFF, 2)) == exception(3, 2)
    assert wire.ask(read(3, 0, 1)) == exception(3, 2)
    assert wire.ask(read(4, 0x8004, 2)) == exception(4, 2)
    assert wire.ask(read(3, 0x1000, 1)) == exception(3, 2)
    assert wire.ask(write_one(6, 0x1000, 1)) == exception(6, 2)
    assert wire.ask(write_one(5, 0x1408, 0xFF00)) == exception(5, 2)


def test_a_coil_takes_only_the_two_values_that_modbus_has(wire):
    for value in (0x0001, 0x00FF, 0xFF01, 0xFFFF):
        assert wire.ask(write_one(5, 0x1407, value)) == exception(5, 3)
    assert wire.ask(read(1, 0x1407, 1)) == bytes([1, 1, 0])
    on = write_one(5, 0x1407, 0xFF00)
    assert wire.ask(on) == on
    assert wire.ask(read(1, 0x1407, 1)) == bytes([1, 1, 1])


def test_unknown_functions(wire):
    bodies = {
        0x16: struct.pack(">HHH", MAX_SPEED, 0xFFFF, 1),
        0x17: struct.pack(">HHHHBH", MAX_SPEED, 1, MAX_SPEED, 1, 2, 500),
        0x2B: bytes([0x0E, 1, 0]),
    }
    for function in (0x00, 0x07, 0x08, 0x16, 0x17, 0x2B, 0x63, 0x7F):
        answer = wire.ask(bytes([function]) + bodies.get(function, b""))
        assert answer == exception(function, 1), hex(function)
    assert wire.holding(MAX_SPEED, 1) == [1000]


# Whom it is for


def test_another_protocol_gets_no_answer(wire):
    wire.send(frame(read(3, MAX_SPEED, 1), protocol=1))
    assert wire.is_silent()
    assert wire.holding(MAX_SPEED, 1) == [1000]


def test_another_unit_gets_no_answer(wire):
    for unit in (2, 9, 247, 254):
        wire.send(frame(write_one(6, MAX_SPEED, 500), unit=unit))
    assert wire.is_silent()
    for unit in (0, 1, 255):
        assert wire.ask(IDENTIFICATION, unit) == HW_VER_IS_1
    assert wire.holding(MAX_SPEED, 1) == [1000]


# Connections


def test_a_ninth_connection_is_closed_at_once(dial):
    served = [dial() for _ in range(CONNECTIONS)]
    for wire in served:
        assert wire.ask(IDENTIFICATION) == HW_VER_IS_1
    assert dial().is_closed()
    for wire in served:
        assert wire.ask(IDENTIFICATION) == HW_VER_IS_1
    served[3].close()
    deadline = time.monotonic() + 2
    while not is_served(dial()):
        assert time.monotonic() < deadline, "the place of the closed connection stays taken"


def is_served(wire: Wire) -> bool:
    try:
        return wire.ask(IDENTIFICATION) == HW_VER_IS_1
    except (AssertionError, OSError):
        return False


@pytest.mark.parametrize("length", [0, 65_535])
def test_a_length_field_that_lies_ends_the_connection(dial, length):
    wire = dial()
    wire.send(struct.pack(">HHHB", 1, 0, length, 1) + IDENTIFICATION)
    assert wire.is_closed()
    assert dial().ask(IDENTIFICATION) == HW_VER_IS_1


def test_garbage_disturbs_nobody_else(dial, wire):
    noise = random.Random(20)
    for length in (1, 6, 7, 8, 64, 4096):
        stranger = dial()
        stranger.send(noise.randbytes(length))
        stranger.close()
        assert wire.holding(MAX_SPEED, 1) == [1000]


def test_a_client_that_leaves_in_the_middle_of_a_request(dial, wire):
    request = frame(write_one(6, MAX_SPEED, 500))
    for cut in range(1, len(request)):
        leaver = dial()
        leaver.send(request[:cut])
        leaver.close()
    assert wire.holding(MAX_SPEED, 1) == [1000]


def test_a_client_that_reads_no_replies_holds_up_nobody(dial, wire):
    deaf = dial()
    deaf.socket.setblocking(False)
    requests = frame(IDENTIFICATION) * 4096
    try:
        for _ in range(64):
            deaf.socket.send(requests)
    except BlockingIOError:
        pass
    started = time.monotonic()
    for _ in range(20):
        assert wire.holding(MAX_SPEED, 1) == [1000]
    assert time.monotonic() - started < 1


def test_a_motion_goes_on_without_its_client(dial):
    leaver = dial()
    leaver.log_in()
    leaver.ask(write_registers(0x1101, [1000, 5_000, 5_000]))
    target = 200 * 16
    leaver.ask(write_registers(TARGET_POS, [target, 0]))
    leaver.send(frame(write_one(6, CMD, 0x10)) + frame(read(3, MAX_SPEED, 1))[:5])
    leaver.receive()
    leaver.close()

    witness = dial()
    witness.log_in()
    assert position(witness) < target
    deadline = time.monotonic() + 3
    # STOP and READY, energised, forward, no error.
    while witness.ask(read(2, 0x1200, 10)) != bytes([2, 2, 0b0010_0010, 0b01]):
        assert time.monotonic() < deadline
    assert position(witness) == target


def position(wire: Wire) -> int:
    """ABS_POS, which does not go negative here."""
    answer = wire.ask(read(4, 0x1001, 2))
    low, high = struct.unpack(">HH", answer[2:])
    return high << 16 | low
