"""An SMSD by its standard binary protocol, over a serial port and over TCP, and a running rig that has one.

Nothing here knows stepdrive: it is what is known of the maker's protocol, written down once more.
"""

import socket
import struct
import time
from typing import NamedTuple

import serial

from control import Control
from controller import Pymodbus
from rig import HOST, Rig

REPLY_SECONDS = 2
SILENT_SECONDS = 0.15
CLOSED_SECONDS = 0.05
# Half a packet that is left so long is dropped.
HALF_PACKET_SECONDS = 0.4

START, STOP, ESCAPE = 0xFA, 0xFB, 0xFE
MAX_DATA = 1024
LINES = 255

# CMD_TYPE
REQUEST, RESPONSE, POWERSTEP01, W_MEM0, R_MEM0 = 0, 1, 2, 3, 7
CONFIG_SET, CONFIG_GET, PASSWORD_SET, ERROR_GET, VERSION_GET = 11, 12, 13, 14, 16

# ERROR_OR_COMMAND
OK, OK_ACCESS, ERROR_ACCESS, ERROR_ACCESS_TIMEOUT, ERROR_XOR, ERROR_NO_COMMAND, ERROR_LEN, ERROR_RANGE = range(8)
ERROR_WRITE, ERROR_READ, ERROR_PROGRAMS, ERROR_WRITE_SETUP, NO_NEXT, END_PROGRAMS = range(8, 14)
GOT_STATUS_IN_EVENT, GOT_MODE, GOT_ABS_POS, GOT_EL_POS, GOT_SPEED, GOT_MIN_SPEED, GOT_MAX_SPEED = range(14, 21)
GOT_STACK, STATUS_RELE_SET, STATUS_RELE_CLR = range(21, 24)

# Instructions
END, GET_SPEED, STATUS_IN_EVENT, SET_MODE, GET_MODE, SET_MIN_SPEED, SET_MAX_SPEED, SET_ACC = range(0x08)
SET_DEC, SET_FS_SPEED, SET_MASK_EVENT, GET_ABS_POS, GET_EL_POS, GET_STATUS_AND_CLR = range(0x08, 0x0E)
RUN_F, RUN_R, MOVE_F, MOVE_R, GO_TO_F, GO_TO_R, GO_UNTIL_F, GO_UNTIL_R = range(0x0E, 0x16)
SCAN_ZERO_F, SCAN_ZERO_R, SCAN_LABEL_F, SCAN_LABEL_R, GO_ZERO, GO_LABEL, GO_TO = range(0x16, 0x1D)
RESET_POS, RESET_POWERSTEP01, SOFT_STOP, HARD_STOP, SOFT_HI_Z, HARD_HI_Z = range(0x1D, 0x23)
SET_WAIT, SET_RELE, CLR_RELE, GET_RELE, WAIT_IN0, WAIT_IN1, GOTO_PROGRAM = range(0x23, 0x2A)
GOTO_PROGRAM_IF_IN0, GOTO_PROGRAM_IF_IN1, LOOP_PROGRAM, CALL_PROGRAM, RETURN_PROGRAM = range(0x2A, 0x2F)
START_PROGRAM_MEM0, STOP_PROGRAM_MEM, STEP_CLOCK, STOP_USB = 0x2F, 0x33, 0x34, 0x35
GET_MIN_SPEED, GET_MAX_SPEED, GET_STACK, GOTO_PROGRAM_IF_ZERO, GOTO_PROGRAM_IF_IN_ZERO = range(0x36, 0x3B)
WAIT_CONTINUE, SET_WAIT_2, SCAN_MARK2_F, SCAN_MARK2_R = range(0x3B, 0x3F)
# Those that came with version 2 of the protocol.
NEWER = range(GOTO_PROGRAM_IF_IN_ZERO, SCAN_MARK2_R + 1)

# What an instruction that was carried out is answered with, where it is not OK.
CODES = {
    END: END_PROGRAMS,
    GET_SPEED: GOT_SPEED,
    STATUS_IN_EVENT: GOT_STATUS_IN_EVENT,
    GET_MODE: GOT_MODE,
    GET_ABS_POS: GOT_ABS_POS,
    GET_EL_POS: GOT_EL_POS,
    SET_RELE: STATUS_RELE_SET,
    CLR_RELE: STATUS_RELE_CLR,
    GET_RELE: STATUS_RELE_CLR,
    STOP_USB: END_PROGRAMS,
    GET_MIN_SPEED: GOT_MIN_SPEED,
    GET_MAX_SPEED: GOT_MAX_SPEED,
    GET_STACK: GOT_STACK,
}

# STATUS_POWERSTEP01
HI_Z, READY, SW_F, SW_EVN, FORWARD, MOT_STATUS, CMD_ERROR = 0x01, 0x02, 0x04, 0x08, 0x10, 0x60, 0x80

# The counters of ERROR_GET
COUNTERS = """N_STARTS XT TIME_OUT INIT_POWERSTEP01 INIT_WIZNET INIT_FRAM SOCKET FRAM INTERRUPT EXTERN_5V EXTERN_VDD
    THERMAL_POWERSTEP01 THERMAL_BRAKE COMMAND_POWERSTEP01 UVLO_POWERSTEP01 STALL_POWERSTEP01 WORK_PROGRAM""".split()

# As printed, and as it goes over the wire.
PASSWORD = bytes.fromhex("0123456789ABCDEF")[::-1]


def checksum(rest: bytes) -> int:
    """XOR_SUM of a packet whose other bytes are `rest`."""
    total = 0xFF
    for byte in rest:
        total = total + byte & 0xFF
    return ~total & 0xFF


def packet(kind: int, data: bytes = b"", ident: int = 1, version: int = 2, length: int = None) -> bytes:
    """A packet, with a length that may be wrong."""
    rest = struct.pack("<BBBH", version, kind, ident, len(data) if length is None else length) + data
    return bytes([checksum(rest)]) + rest


def stuffed(raw: bytes) -> bytes:
    """A packet between start and stop."""
    inside = bytearray()
    for byte in raw:
        inside += bytes([ESCAPE, byte ^ 0x80]) if byte in (START, STOP, ESCAPE) else bytes([byte])
    return bytes([START]) + bytes(inside) + bytes([STOP])


def unstuffed(frame: bytes) -> bytes:
    """The packet between start and stop."""
    assert frame[:1] == bytes([START]) and frame[-1:] == bytes([STOP]), f"no whole frame, but {frame.hex(' ')}"
    inside = frame[1:-1]
    assert START not in inside and STOP not in inside, frame.hex(" ")
    raw, place = bytearray(), 0
    while place < len(inside):
        escaped = inside[place] == ESCAPE
        place += escaped
        raw.append(inside[place] ^ 0x80 if escaped else inside[place])
        assert not escaped or raw[-1] in (START, STOP, ESCAPE), frame.hex(" ")
        place += 1
    return bytes(raw)


def word(code: int, data: int = 0) -> int:
    """An instruction with its data, of which negative numbers are two's complement."""
    return (data & 0x3FFFFF) << 10 | code << 4


def words(data: bytes) -> list[int]:
    return [value for (value,) in struct.iter_unpack("<I", data)]


def free_port() -> int:
    """A TCP port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return probe.getsockname()[1]


def wait_listening(port: int, seconds: float = 5):
    """Until a controller is reached at the port that its LAN parameters name: it moves there behind its reply."""
    deadline = time.monotonic() + seconds
    while True:
        try:
            return socket.create_connection((HOST, port)).close()
        except ConnectionRefusedError:
            assert time.monotonic() < deadline, f"nobody listens on {port}"
            time.sleep(0.005)


class Packet(NamedTuple):
    """What came back, its checksum and length already found right."""

    version: int
    kind: int
    ident: int
    data: bytes

    @classmethod
    def parse(cls, raw: bytes):
        assert len(raw) >= 6 and sum(raw) % 256 == 0, raw.hex(" ")
        _, version, kind, ident, length = struct.unpack("<BBBBH", raw[:6])
        assert length == len(raw) - 6, raw.hex(" ")
        return cls(version, kind, ident, raw[6:])


class Answer(NamedTuple):
    """The status structure, and what it came in."""

    kind: int
    ident: int
    status: int
    code: int
    data: int

    @classmethod
    def of(cls, reply: Packet):
        assert reply.kind in (RESPONSE, POWERSTEP01) and len(reply.data) == 7, reply
        return cls(reply.kind, reply.ident, *struct.unpack("<HBI", reply.data))


class Lan(NamedTuple):
    """The LAN parameters. Without `ident` they are those of the standard firmware."""

    mac: bytes
    ip: bytes
    subnet_mask: bytes
    gateway: bytes
    dns: bytes
    port: int
    dhcp: int
    ident: int = None

    @classmethod
    def parse(cls, data: bytes):
        assert len(data) in (25, 26), data.hex(" ")
        return cls(*struct.unpack("<6s4s4s4s4sHB" + "B" * (len(data) - 25), data))

    def pack(self) -> bytes:
        data = struct.pack("<6s4s4s4s4sHB", *self[:7])
        return data if self.ident is None else data + bytes([self.ident])


FACTORY_LAN = Lan(
    bytes.fromhex("00F8DC3F0000"), bytes([192, 168, 1, 2]), bytes([255, 255, 0, 0]), bytes([192, 168, 1, 1]), bytes(4), 502, 1, 1
)


class Stuffed:
    """Packets between start and stop: the serial port, or the same bytes over TCP."""

    greets = False

    def __init__(self, url: str):
        self.port = serial.serial_for_url(url, baudrate=115200, bytesize=8, parity="N", stopbits=1, timeout=REPLY_SECONDS)

    def write(self, data: bytes):
        self.port.write(data)

    def send(self, raw: bytes):
        self.write(stuffed(raw))

    def receive(self) -> bytes:
        return unstuffed(self.port.read_until(bytes([STOP])))

    def is_silent(self, seconds: float = SILENT_SECONDS) -> bool:
        self.port.timeout = seconds
        came = self.port.read(1)
        self.port.timeout = REPLY_SECONDS
        return came == b""

    def close(self):
        self.port.close()


class Raw:
    """Packets one behind the other, as over TCP with the standard firmware."""

    greets = True

    def __init__(self, place: str):
        host, port = place.rsplit(":", 1)
        self.socket = socket.create_connection((host, int(port)), timeout=REPLY_SECONDS)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def write(self, data: bytes):
        self.socket.sendall(data)

    def send(self, raw: bytes):
        self.write(raw)

    def receive(self) -> bytes:
        head = self._exactly(6)
        return head + self._exactly(int.from_bytes(head[4:], "little"))

    def is_silent(self, seconds: float = SILENT_SECONDS) -> bool:
        self.socket.settimeout(seconds)
        try:
            self.socket.recv(1)
        except TimeoutError:
            return True
        finally:
            self.socket.settimeout(REPLY_SECONDS)
        return False

    def is_closed(self) -> bool:
        """Waits for the controller to close the connection, without another byte."""
        try:
            return self.socket.recv(1) == b""
        except ConnectionError:
            return True
        except TimeoutError:
            return False

    def close(self):
        self.socket.close()

    def _exactly(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            part = self.socket.recv(count - len(data))
            assert part, f"closed after {data.hex(' ')}"
            data += part
        return data


class Smsd:
    """A controller at the other end of a line."""

    def __init__(self, line, version: int = 2):
        self.line = line
        self.version = version
        self.ident = 0
        if line.greets:
            greeting = Packet.parse(line.receive())
            assert greeting == (version, REQUEST, 0, b""), greeting

    def close(self):
        self.line.close()

    def receive(self) -> Packet:
        reply = Packet.parse(self.line.receive())
        assert reply.version == self.version
        return reply

    def ask(self, kind: int, data: bytes = b"", ident: int = None) -> Packet:
        """A packet and the reply to it, which repeats its identification."""
        self.ident = self.ident % 255 + 1 if ident is None else ident
        self.line.send(packet(kind, data, self.ident, self.version))
        reply = self.receive()
        assert reply.ident == self.ident, reply
        return reply

    def answer(self, kind: int, data: bytes = b"") -> Answer:
        """A packet, and the status structure that answers it."""
        return Answer.of(self.ask(kind, data))

    def code(self, kind: int, data: bytes = b"") -> int:
        """A packet that is no instruction, and the code that answers it."""
        answer = self.answer(kind, data)
        assert (answer.kind, answer.data) == (RESPONSE, 0), answer
        return answer.code

    # Instructions
    def give(self, code: int, data: int = 0) -> Answer:
        """An instruction, whatever becomes of it."""
        return self.answer(POWERSTEP01, word(code, data).to_bytes(4, "little"))

    def do(self, code: int, data: int = 0) -> int:
        """An instruction that is carried out; returns its value."""
        answer = self.give(code, data)
        expected = CODES.get(code, OK)
        assert (answer.kind, answer.code) == (POWERSTEP01, expected), f"{code:02X}: {answer}"
        assert not answer.status & CMD_ERROR, f"{code:02X}: {answer}"
        return answer.data

    def refusal(self, code: int, data: int = 0) -> int:
        """The code that an instruction is refused with."""
        answer = self.give(code, data)
        assert (answer.kind, answer.data) == (RESPONSE, 0), f"{code:02X}: {answer}"
        return answer.code

    def status(self) -> int:
        return self.give(GET_ABS_POS).status

    def position(self) -> int:
        # Bit 21 is the sign, however many bits above the controller has filled.
        return (self.do(GET_ABS_POS) & 0x3FFFFF ^ 0x200000) - 0x200000

    def relay_is_on(self) -> bool:
        answer = self.give(GET_RELE)
        assert answer.code in (STATUS_RELE_SET, STATUS_RELE_CLR), answer
        return answer.code == STATUS_RELE_SET

    def wait_ready(self, seconds: float = 5):
        deadline = time.monotonic() + seconds
        while not self.status() & READY:
            assert time.monotonic() < deadline, "it does not become ready"
            time.sleep(0.002)

    # Packets of other types
    def try_password(self, password: bytes) -> int:
        return self.code(REQUEST, password)

    def log_in(self, password: bytes = PASSWORD):
        """Tries until the controller will look at the password."""
        while (code := self.try_password(password)) == ERROR_ACCESS_TIMEOUT:
            time.sleep(0.02)
        assert code == OK_ACCESS, code

    def write_memory(self, area: int, program: list[int]) -> int:
        return self.code(W_MEM0 + area, struct.pack(f"<{len(program)}I", *program))

    def read_memory(self, area: int) -> list[int]:
        return words(self._read(R_MEM0 + area))

    def set_lan(self, lan: Lan) -> int:
        return self.code(CONFIG_SET, lan.pack())

    def lan(self) -> Lan:
        return Lan.parse(self._read(CONFIG_GET))

    def set_password(self, password: bytes) -> int:
        return self.code(PASSWORD_SET, password)

    def counters(self) -> dict[str, int]:
        """The counters that are not zero."""
        values = words(self._read(ERROR_GET))
        return {name: value for name, value in zip(COUNTERS, values, strict=True) if value}

    def versions(self) -> tuple[int, ...]:
        return struct.unpack("<4HB", self._read(VERSION_GET))

    def state(self) -> tuple:
        """All that can be read and does not change by itself while the motor stands."""
        numbers = [self.give(code) for code in (GET_ABS_POS, GET_EL_POS, GET_MODE, GET_MIN_SPEED, GET_MAX_SPEED)]
        numbers += [self.give(code) for code in (STATUS_IN_EVENT, GET_RELE, GET_STACK)]
        values = [(answer.status, answer.code, answer.data) for answer in numbers]
        return values, [self.read_memory(area) for area in range(4)], self.lan()

    def _read(self, kind: int) -> bytes:
        """What a packet without data is answered with: one of the same type."""
        reply = self.ask(kind)
        assert reply.kind == kind, reply
        return reply.data


RIG = """\
[rig]
clock = "CLOCK"
api = "{host}:0"
[[drive]]
name = "stage"
model = "{model}"
PORTS
[drive.motor]
steps_per_rev = 200
[drive.mechanics]
travel = [-10000.0, 10000.0]
[[drive.switch]]
input = "SET_ZERO"
closed = [-120.0, -100.0]
[[drive.switch]]
input = "IN1"
closed = [300.0, 320.0]
"""

USB = 'usb = "pty"\n'
USB_AND_MODBUS = USB + 'usb_tcp = "{host}:0"\nmodbus_tcp = "{host}:0"\n'
USB_AND_STANDARD = USB + 'lan = "standard"\nstandard_tcp = "{host}:0"\n'


class UsbRig(Rig):
    """One SMSD named `stage` that is reached in several ways, under control of the API."""

    def __init__(self, folder, model: str = "SMSD-4.2LAN", ports: str = USB_AND_MODBUS, clock: str = "paused"):
        self.text = RIG.replace("PORTS", ports).replace("CLOCK", clock)
        super().__init__(folder, model)
        self.version = 1 if "protocol_version = 1" in ports else 2
        self.control = None
        self.drive = {}
        self.opened = []

    def _announced(self, ready):
        self.control = self._opened(Control(ready["api"]))
        (self.drive,) = ready["drives"]
        assert (self.drive["name"], self.drive["model"]) == ("stage", self.model)

    def open(self, transport: str = "usb") -> Smsd:
        """A connection over `usb`, `usb_tcp` or `standard_tcp`."""
        place = self.drive[transport]
        if transport == "standard_tcp":
            return self._opened(Smsd(Raw(place), self.version))
        return self._opened(Smsd(Stuffed(place if transport == "usb" else f"socket://{place}"), self.version))

    def logged_in(self, transport: str = "usb") -> Smsd:
        """The same, logged in. A second of rig time passes for it."""
        client = self.open(transport)
        self.pass_time("1s")
        assert client.try_password(PASSWORD) == OK_ACCESS
        return client

    def close(self, client: Smsd):
        """Closes a serial port, and gives the controller the time to notice."""
        client.close()
        time.sleep(CLOSED_SECONDS)

    def pass_time(self, time: str):
        self.control.step(time)

    def run(self, until: str = "stage.READY"):
        """Lets rig time pass until something is so."""
        self.control.run_until(until)

    def modbus(self, port: int = None, unit: int = 1) -> Pymodbus:
        return self._opened(Pymodbus(port or self.modbus_port(), unit))

    def modbus_logged_in(self) -> Pymodbus:
        client = self.modbus()
        client.log_in()
        return client

    def modbus_port(self) -> int:
        host, port = self.drive["modbus_tcp"].rsplit(":", 1)
        assert host == HOST
        return int(port)

    def close_clients(self):
        for client in self.opened:
            client.close()
        self.opened = []

    def _opened(self, client):
        self.opened.append(client)
        return client

    def __enter__(self):
        try:
            self.start()
        except BaseException:
            self.clean_up()
            raise
        return self

    def __exit__(self, kind, *_):
        """It must still be running at the end, and end with 0."""
        try:
            if kind is None:
                assert self.is_running(), self.complaints()
                self.stop()
        finally:
            self.close_clients()
            self.clean_up()
