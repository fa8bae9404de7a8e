"""A plain socket that speaks Modbus TCP, well or badly."""

import socket
import struct
import time

from controller import PASSWORD, password_words
from rig import HOST

SECONDS = 2


def read(function: int, address: int, count: int) -> bytes:
    """The PDU of function codes 01 to 04."""
    return struct.pack(">BHH", function, address, count)


def write_one(function: int, address: int, value: int) -> bytes:
    """The PDU of function codes 05 and 06."""
    return struct.pack(">BHH", function, address, value)


def write_registers(address: int, values: list[int]) -> bytes:
    """The PDU of function code 10."""
    head = struct.pack(">BHHB", 0x10, address, len(values), 2 * len(values) & 0xFF)
    return head + struct.pack(f">{len(values)}H", *values)


def frame(pdu: bytes, transaction: int = 1, unit: int = 1, protocol: int = 0) -> bytes:
    """A PDU behind its MBAP header."""
    return struct.pack(">HHHB", transaction, protocol, len(pdu) + 1, unit) + pdu


class Wire:
    """One connection."""

    def __init__(self, port: int):
        self.socket = socket.create_connection((HOST, port), timeout=SECONDS)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.transaction = 0x1000

    def close(self):
        self.socket.close()

    def send(self, data: bytes):
        self.socket.sendall(data)

    def receive(self, unit: int = 1) -> tuple[int, bytes]:
        """One whole reply: its transaction and its PDU."""
        transaction, protocol, length, answered_by = struct.unpack(">HHHB", self._exactly(7))
        assert (protocol, answered_by) == (0, unit)
        return transaction, self._exactly(length - 1)

    def ask(self, pdu: bytes, unit: int = 1) -> bytes:
        """A well-formed request and the PDU of its reply."""
        self.transaction += 1
        self.send(frame(pdu, self.transaction, unit))
        transaction, answer = self.receive(unit)
        assert transaction == self.transaction
        return answer

    def log_in(self):
        self.ask(write_registers(0x2100, password_words(PASSWORD) + [0]))
        assert self.ask(read(2, 0x2200, 1)) == bytes([2, 1, 1])

    def holding(self, address: int, count: int) -> list[int]:
        """Function code 03."""
        answer = self.ask(read(3, address, count))
        assert answer[:2] == bytes([3, 2 * count])
        return list(struct.unpack(f">{count}H", answer[2:]))

    def is_silent(self, seconds: float = 0.15) -> bool:
        """No byte comes, and the connection stays open."""
        self.socket.settimeout(seconds)
        try:
            self.socket.recv(1)
        except TimeoutError:
            return True
        finally:
            self.socket.settimeout(SECONDS)
        return False

    def is_closed(self, seconds: float = SECONDS) -> bool:
        """The controller closes the connection, without another byte."""
        self.socket.settimeout(seconds)
        try:
            return self.socket.recv(1) == b""
        except ConnectionError:
            return True
        except TimeoutError:
            return False

    def _exactly(self, count: int) -> bytes:
        data = b""
        deadline = time.monotonic() + SECONDS
        while len(data) < count:
            assert time.monotonic() < deadline, f"only {data.hex()} came"
            part = self.socket.recv(count - len(data))
            assert part, f"closed after {data.hex()}"
            data += part
        return data
