"""Controllers that are none of ours, written from the makers' manuals alone, and the command line that is to speak to them.

`Smsd` is a server of pymodbus with the register map of the manual's appendix A. `Smd3` is a pseudo-terminal that answers as
the manual's chapter on USB says. `Peer` is a socket that answers Modbus TCP as badly as it is told to.
"""

import asyncio
import json
import os
import select
import socket
import struct
import subprocess
import tempfile
import threading
import tty

from pymodbus.constants import ExcCodes
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

HOST = "127.0.0.1"
# No command of these tests has a reason to take longer.
LONGEST_SECONDS = 8


class Cli:
    """The command line, with a home of its own, which it keeps from one command to the next."""

    def __init__(self, folder):
        self.folder = folder
        places = ("HOME", "XDG_STATE_HOME", "XDG_CONFIG_HOME", "XDG_RUNTIME_DIR")
        self.environment = dict(os.environ) | {place: str(folder) for place in places}

    def run(self, *words: str, **variables: str) -> subprocess.CompletedProcess:
        """A command as it ends, which it does in good time."""
        program = os.environ["STEPDRIVE"]
        return subprocess.run(
            [program, *words],
            cwd=self.folder,
            env=self.environment | variables,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=LONGEST_SECONDS,
        )

    def json(self, *words: str, code: int = 0, **variables: str):
        """What a command says in JSON."""
        done = self.run(*words, "--json", **variables)
        assert done.returncode == code, done
        return json.loads(done.stdout)

    def fails(self, code: int, *words: str, **variables: str) -> str:
        """The one sentence of a command that fails."""
        done = self.run(*words, **variables)
        assert (done.returncode, done.stdout) == (code, ""), done
        assert done.stderr.startswith("stepdrive: ") and done.stderr.count("\n") == 1, done
        return done.stderr.removeprefix("stepdrive: ").rstrip("\n")


# ---- an SMSD by pymodbus

PASSWORD = 0x0123456789ABCDEF

# Appendix A, in its words: (address, name, registers, value). The values are none of the defaults, so that nothing that
# is read can have been made up.
INPUT_REGISTERS = [
    (0x1000, "SPEED", 1, 0),
    (0x1001, "ABS_POS", 2, -70_000),
    (0x1003, "EL_POS", 1, 0x0150),
    (0x1004, "STATUS", 1, 0),
    (0x1005, "Inputs", 1, 0x0085),
    (0x3000, "MODE_N_PROGRAMS", 1, 3),
    (0x3001, "N_PROGRAM", 1, 2),
    (0x3002, "N_COMMAND", 1, 17),
    (0x8001, "HW_MAJOR", 1, 7),
    (0x8002, "HW_VER", 1, 1),
    (0x8003, "FW_MAJOR", 1, 1),
    (0x8004, "FW_MINOR", 1, 3),
    (0x8007, "RM_MAJOR", 1, 4),
    (0x8008, "RM_MINOR", 1, 3),
]
HOLDING_REGISTERS = [
    (0x1100, "MIN_SPEED", 1, 30),
    (0x1101, "MAX_SPEED", 1, 1200),
    (0x1102, "ACC", 1, 2000),
    (0x1103, "DEC", 1, 2500),
    (0x1104, "FS_SPEED", 1, 9000),
    (0x1105, "TARGET_SPEED", 1, 150),
    (0x1106, "TARGET_POS", 2, -123_456),
    (0x1108, "TARGET_INPUT", 1, 1),
    (0x1109, "CMD", 1, 0),
    (0x110A, "CURRENT_OR_VOLTAGE", 1, 0),
    (0x110B, "MOTOR_TYPE", 1, 7),
    (0x110C, "MICROSTEPPING", 1, 3),
    (0x110D, "WORK_CURRENT", 1, 42),
    (0x110E, "STOP_CURRENT", 1, 2),
    (0x110F, "Mask", 1, 0x0007),
    (0x1110, "Wait", 1, 0),
    (0x2100, "Password_LOW32", 2, 0),
    (0x2102, "Password_HIGH32", 2, 0),
    (0x2104, "Password_CMD", 1, 0),
    *[(0x3100 + 2 * line, f"CMD {line:02}", 2, 0x00019060 + line) for line in range(32)],
    (0x3180, "N_PROG", 1, 1),
    (0x3181, "N_STR", 1, 5),
    (0x3182, "SECTOR_SIZE", 1, 32),
    (0x3183, "PROG_SIZE", 1, 100),
    (0x3184, "MEM_CMD", 1, 0),
    (0x7000, "ID", 1, 1),
    *[(0x7001 + place, f"MAC {place}", 1, 0x10 + place) for place in range(6)],
    *[(0x7007 + place, f"IP {place}", 1, octet) for place, octet in enumerate([10, 1, 2, 3])],
    *[(0x700B + place, f"Subnet Mask {place}", 1, octet) for place, octet in enumerate([255, 255, 255, 0])],
    *[(0x700F + place, f"Gateway IP {place}", 1, octet) for place, octet in enumerate([10, 1, 2, 254])],
    *[(0x7013 + place, f"DNS server IP Address {place}", 1, octet) for place, octet in enumerate([9, 9, 9, 9])],
    (0x7017, "Port", 1, 502),
    (0x7018, "DHCP", 1, 1),
]
DISCRETE_INPUTS = [
    (0x1200, "HiZ", True),
    (0x1201, "STOP", True),
    (0x1202, "CONST_SPEED", False),
    (0x1203, "ACC", False),
    (0x1204, "DEC", False),
    (0x1205, "READY", True),
    (0x1206, "SW_F", True),
    (0x1207, "SW_EVN", False),
    (0x1208, "DIR", False),
    (0x1209, "CMD_ERROR", False),
    (0x2200, "Access", False),
    (0x3200, "PROGRAM_RUN", False),
]
COILS = [
    (0x1400, "CLR", False),
    (0x1401, "Reset Pos", False),
    (0x1402, "Reset powerSTEP01", False),
    (0x1403, "Soft STOP", False),
    (0x1404, "Hard STOP", False),
    (0x1405, "Soft HiZ", False),
    (0x1406, "Hard HiZ", False),
    (0x1407, "Relay", True),
    (0x3400, "B_COMPLETE", True),
    (0x7400, "Apply Network Configuration", False),
]
KEPT_COILS = (0x1407, 0x3400)
AUTHORISATION = {0x2100, 0x2101, 0x2102, 0x2103, 0x2104, 0x2200}
LOCKOUT_SECONDS = 1.0

READ_COILS, READ_INPUTS, READ_HOLDING, READ_INPUT_REGISTERS = 1, 2, 3, 4
WRITE_COIL, WRITE_REGISTER, WRITE_COILS, WRITE_REGISTERS = 5, 6, 15, 16
READS = (READ_COILS, READ_INPUTS, READ_HOLDING, READ_INPUT_REGISTERS)
ABS_POS, STATUS, TARGET_POS, CMD, PASSWORD_CMD, ACCESS = 0x1001, 0x1004, 0x1106, 0x1109, 0x2104, 0x2200
PROGRAM_RUN, CMD_BUFFER, MEM_CMD, B_COMPLETE = 0x3200, 0x3100, 0x3184, 0x3400
PROGRAM_LINES = 255
# CMD: what changes ABS_POS, and how.
MOVES = {
    0x10: lambda at, target: at + target,
    0x11: lambda at, target: at - target,
    0x12: lambda _, target: target,
    0x13: lambda _, target: target,
    0x1C: lambda _, target: target,
}
# The bits of STATUS as flags of the manual's table: where each is in the word.
STATUS_BITS = {0x1200: 0, 0x1205: 1, 0x1206: 2, 0x1207: 3, 0x1208: 4, 0x1209: 7}


class Smsd:
    """A controller of unit 1: everything is kept that is written, moves take no time. Use it by `with`."""

    def __init__(self, low_first: bool = True, password: int = PASSWORD):
        self.low_first = low_first
        self.password = password
        self.words = {READ_HOLDING: self._map(HOLDING_REGISTERS), READ_INPUT_REGISTERS: self._map(INPUT_REGISTERS)}
        self.bits = {READ_INPUTS: _bits(DISCRETE_INPUTS), READ_COILS: _bits(COILS)}
        self._show_status()
        # What is answered with an exception, and what takes its time, by function and address.
        self.refusals: dict[tuple[int, int], ExcCodes] = {}
        self.delays: dict[tuple[int, int], float] = {}
        self.requests: list[tuple[int, int, int]] = []
        # Of the four memories, the words of every line, and the size.
        self.memories = [[[0, 0]] * PROGRAM_LINES for _ in range(4)]
        self.sizes = [0] * 4
        self.failed_at = -LOCKOUT_SECONDS
        self.port = 0
        self.loop = asyncio.new_event_loop()
        self.thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self):
        ready = threading.Event()
        self.loop.call_soon(lambda: self.loop.create_task(self._listen(ready)))
        self.thread.start()
        assert ready.wait(5), "pymodbus listens"
        return self

    def __exit__(self, *_):
        asyncio.run_coroutine_threadsafe(self._end(), self.loop).result(5)
        self.loop.call_soon_threadsafe(self.loop.stop)
        self.thread.join(5)
        assert not self.thread.is_alive()
        self.loop.close()

    @property
    def place(self) -> str:
        return f"{HOST}:{self.port}"

    def value(self, function: int, address: int, signed: bool = True) -> int:
        """A 32-bit value."""
        words = [self.words[function][address], self.words[function][address + 1]]
        low, high = words if self.low_first else reversed(words)
        value = high << 16 | low
        return value - (1 << 32) if signed and value >> 31 else value

    def writes(self) -> list[tuple[int, int]]:
        """What was written but for the password: function and address."""
        return [(function, address) for function, address, _ in self.requests
                if function not in READS and address not in AUTHORISATION]

    # What follows runs in the server's thread.

    def _serve(self):
        asyncio.set_event_loop(self.loop)
        self.loop.run_forever()

    async def _listen(self, ready: threading.Event):
        def registers(rows):
            return [SimData(address, values=[0] * count, datatype=DataType.REGISTERS) for address, _, count, _ in rows]

        def bits(rows):
            return [SimData(address, values=[False], datatype=DataType.BITS) for address, _, _ in rows]

        blocks = (bits(COILS), bits(DISCRETE_INPUTS), registers(HOLDING_REGISTERS), registers(INPUT_REGISTERS))
        self.server = ModbusTcpServer(
            SimDevice(id=1, simdata=blocks, action=self._touched),
            address=(HOST, 0),
            trace_pdu=self._note,
            trace_packet=self._let_out,
            trace_connect=self._connected,
        )
        await self.server.serve_forever(background=True)
        self.port = self.server.transport.sockets[0].getsockname()[1]
        ready.set()

    async def _end(self):
        await self.server.shutdown()
        others = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)

    def _connected(self, _: bool):
        """Authorisation is valid for one connection."""
        self.bits[READ_INPUTS][ACCESS] = False

    def _note(self, sending: bool, pdu):
        if not sending:
            count = pdu.count or len(pdu.registers) or len(pdu.bits)
            self.requests.append((pdu.function_code, pdu.address, count))
        return pdu

    def _let_out(self, sending: bool, packet: bytes) -> bytes:
        """Units that are not there say nothing."""
        return b"" if sending and packet[6] != 1 else packet

    async def _touched(self, function, start, _address, _count, registers, values):
        """What pymodbus calls before it reads or writes."""
        _, address, count = self.requests[-1]
        touched = range(address, address + count)
        await asyncio.sleep(self.delays.get((function, address), 0))
        for place in touched:
            if refusal := self.refusals.get((function, place)):
                return refusal
        if not self.bits[READ_INPUTS][ACCESS] and not AUTHORISATION.issuperset(touched):
            return ExcCodes.ILLEGAL_ADDRESS
        if function not in READS and values is None:
            # pymodbus reads what it has just written, for the reply.
            return None
        if function in (READ_COILS, READ_INPUTS, WRITE_COIL, WRITE_COILS):
            return self._touch_bits(function, start, touched, registers, values)
        return self._touch_words(function, start, touched, registers, values)

    def _touch_bits(self, function, start, touched, registers, values):
        table = self.bits[READ_INPUTS if function == READ_INPUTS else READ_COILS]
        if not table.keys() >= set(touched):
            return ExcCodes.ILLEGAL_ADDRESS
        for place, value in zip(touched, values or []):
            self._write_coil(place, value)
        registers[:] = [0] * len(registers)
        for place, value in table.items():
            registers[place // 16 - start] |= value << place % 16
        return None

    def _touch_words(self, function, start, touched, registers, values):
        table = self.words[READ_INPUT_REGISTERS if function == READ_INPUT_REGISTERS else READ_HOLDING]
        for place, value in zip(touched, values or []):
            table[place] = value
            if place == CMD:
                self._command(value)
            elif place == MEM_CMD and self._memory(value):
                return ExcCodes.DEVICE_BUSY
            elif place == PASSWORD_CMD and value == 0:
                self._authorise()
        registers[touched.start - start : touched.stop - start] = [table[place] for place in touched]
        return None

    def _authorise(self):
        given = self.value(READ_HOLDING, 0x2102, False) << 32 | self.value(READ_HOLDING, 0x2100, False)
        if self.loop.time() - self.failed_at < LOCKOUT_SECONDS:
            return
        self.bits[READ_INPUTS][ACCESS] = given == self.password
        if given != self.password:
            self.failed_at = self.loop.time()

    def _command(self, code: int):
        if code in MOVES:
            place = MOVES[code](self.value(READ_INPUT_REGISTERS, ABS_POS), self.value(READ_HOLDING, TARGET_POS))
            self.words[READ_INPUT_REGISTERS] |= self._map([(ABS_POS, "ABS_POS", 2, place)])
            self._energise(True)
        if 0x2F <= code <= 0x33:
            self.bits[READ_INPUTS][PROGRAM_RUN] = code < 0x33
            if code < 0x33:
                self.words[READ_INPUT_REGISTERS][0x3001] = code - 0x2F

    def _memory(self, command: int) -> bool:
        """A procedure of chapter 5; whether it is refused, since the flag of the one before was not reset."""
        if self.bits[READ_COILS][B_COMPLETE]:
            return True
        holding = self.words[READ_HOLDING]
        area, line, count, size = (holding[place] for place in range(0x3180, 0x3184))
        lines = self.memories[area]
        buffer = [CMD_BUFFER + 2 * place for place in range(count)]
        if command == 0:
            for place, words in zip(buffer, lines[line : line + count]):
                holding[place], holding[place + 1] = words
        elif command == 1:
            lines[line : line + count] = [[holding[place], holding[place + 1]] for place in buffer]
        elif command == 2:
            lines[:], self.sizes[area] = [[0, 0]] * PROGRAM_LINES, 0
        elif command == 3:
            holding[0x3183] = self.sizes[area]
        elif command == 4:
            self.sizes[area] = size
        self.bits[READ_COILS][B_COMPLETE] = True
        return False

    def _write_coil(self, address: int, value: bool):
        if address in KEPT_COILS:
            self.bits[READ_COILS][address] = value
        elif value and address == 0x1401:
            self.words[READ_INPUT_REGISTERS] |= self._map([(ABS_POS, "ABS_POS", 2, 0)])
        elif value and 0x1403 <= address <= 0x1406:
            self._energise(address <= 0x1404)

    def _energise(self, energised: bool):
        self.bits[READ_INPUTS][0x1200] = not energised
        self._show_status()

    def _show_status(self):
        word = sum(self.bits[READ_INPUTS][flag] << bit for flag, bit in STATUS_BITS.items())
        self.words[READ_INPUT_REGISTERS][STATUS] = word

    def _map(self, rows) -> dict[int, int]:
        words = {}
        for address, _, count, value in rows:
            low, high = value & 0xFFFF, value >> 16 & 0xFFFF
            parts = [low] if count == 1 else [low, high] if self.low_first else [high, low]
            words |= {address + place: part for place, part in enumerate(parts)}
        return words


def _bits(rows) -> dict[int, bool]:
    return {address: value for address, _, value in rows}


# ---- a peer that speaks Modbus TCP badly


def frame(transaction: int, unit: int, pdu: bytes) -> bytes:
    return struct.pack(">HHHB", transaction, 0, len(pdu) + 1, unit) + pdu


def reply_to(pdu: bytes) -> bytes:
    """A PDU that answers: writes are done, access is allowed, everything reads as 0."""
    function, first, second = struct.unpack(">BHH", pdu[:5])
    if function in (READ_COILS, READ_INPUTS):
        size = (second + 7) // 8
        return bytes([function, size, int(first == ACCESS)]) + bytes(size - 1)
    if function in (READ_HOLDING, READ_INPUT_REGISTERS):
        return bytes([function, 2 * second]) + bytes(2 * second)
    return pdu[:5]


class Hangup(Exception):
    """What an answer raises to end the connection, with the bytes that still go out."""


class Peer:
    """A server of one connection at a time that says what `answer(transaction, unit, pdu)` tells it. Use it by `with`."""

    def __init__(self, answer):
        self.answer = answer
        self.socket = socket.create_server((HOST, 0))
        self.place = f"{HOST}:{self.socket.getsockname()[1]}"
        self.connections = 0
        self.requests: list[bytes] = []
        self.stopped = threading.Event()
        self.thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.stopped.set()
        # Wakes it up where it waits.
        socket.create_connection(self.socket.getsockname()).close()
        self.thread.join(5)
        assert not self.thread.is_alive()
        self.socket.close()

    def _serve(self):
        while not self.stopped.is_set():
            connection, _ = self.socket.accept()
            self.connections += 1
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            with connection:
                try:
                    self._converse(connection)
                except Hangup as hangup:
                    connection.sendall(*hangup.args or (b"",))
                except OSError:
                    pass

    def _converse(self, connection: socket.socket):
        while head := connection.recv(7, socket.MSG_WAITALL):
            transaction, _, length, unit = struct.unpack(">HHHB", head)
            pdu = connection.recv(length - 1, socket.MSG_WAITALL)
            self.requests.append(pdu)
            connection.sendall(self.answer(transaction, unit, pdu))


# ---- an SMD3 at a pseudo-terminal

STANDBY, EMERGENCY_STOP = 0x0040, 0x0020
# The quick reference: what can be read, with values as the manual says that they are printed.
READINGS = {
    "SER": "30128-017", "FW": "20168.1", "IDENT": "0", "MODE": "2 (Remote)", "JSMODE": "0", "AUTOJS": "1", "EXTEN": "0",
    "TSEL": "0", "TMOT": "2.31400E+01", "IR": "5.00000E-01", "IA": "7.50000E-01", "IH": "1.25000E-01",
    "PDDEL": "1.09227E+02", "IHD": "2.18453E+01", "F": "0", "RES": "256",
    "L": "1", "L+": "1", "L-": "0", "LP+": "0", "LP-": "1", "LSM": "0",
    "AMAX": "5.00000E+02", "DMAX": "6.00000E+02", "VSTART": "1.00000E+01", "VSTOP": "2.00000E+01", "VMAX": "2.50000E+02",
    "VACT": "0.00000E+00", "PACT": "1.23450E+03", "PREL": "-5.00000E+00", "TZW": "0.00000E+00", "THIGH": "4.00000E+02",
    "EDGE": "0", "INTERP": "1", "BAKET": "150",
}
READ_ONLY = ("SER", "FW", "TMOT", "VACT")
MODES = ("Step/direction", "Step/direction triggered velocity", "Remote", "Joystick", "Bake", "Home")
# For so many readings of VACT a motion goes on.
LOOKS = 2
UNPLUG = object()


class Smd3:
    """A drive at `path`. `script` says what lines are answered instead of what the manual says: bytes as they are, `None` for
    silence, or `UNPLUG`; of a list, one after another, and the last from then on. Use it by `with`."""

    def __init__(self, script: dict | None = None):
        self.script = {line: list(says) if isinstance(says, list) else [says] for line, says in (script or {}).items()}
        self.values = dict(READINGS)
        self.status, self.errors = STANDBY, 0
        self.target, self.looks = None, 0
        self.lines: list[str] = []
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        # A name of its own: the number of one that is gone may be given to the next at once.
        self.folder = tempfile.TemporaryDirectory()
        self.path = os.path.join(self.folder.name, "ttyACM0")
        os.symlink(os.ttyname(self.slave), self.path)
        self.stopped, self.stop = os.pipe()
        self.thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        os.write(self.stop, b"x")
        self.thread.join(5)
        assert not self.thread.is_alive()
        self.unplug()
        os.close(self.stopped)
        os.close(self.stop)

    def unplug(self):
        """Takes the device away from whoever has it open."""
        self.folder.cleanup()
        for descriptor in (self.master, self.slave):
            if descriptor >= 0:
                os.close(descriptor)
        self.master = self.slave = -1

    def asked(self) -> list[str]:
        """The lines that came, but for those that only find out whether the line is in order."""
        return [line for line in self.lines if line not in (",?", "SER")]

    def _serve(self):
        received = b""
        while True:
            sources = [self.stopped] + ([self.master] if self.master >= 0 else [])
            readable, _, _ = select.select(sources, [], [])
            if self.stopped in readable:
                return
            received += os.read(self.master, 4096)
            while b"\r\n" in received and self.master >= 0:
                line, received = received.split(b"\r\n", 1)
                self._hear(line.decode())

    def _hear(self, line: str):
        self.lines.append(line)
        says = self._scripted(line)
        if says is UNPLUG:
            self.unplug()
        elif says is not None:
            os.write(self.master, says)

    def _scripted(self, line: str):
        for key in (line, line.split(",")[0], "*"):
            if says := self.script.get(key):
                return says.pop(0) if len(says) > 1 else says[0]
        return self.reply(*self._obey(line.upper().split(",")))

    def reply(self, *items: str) -> bytes:
        flags = [f"0x{self.status:04X}", f"0x{self.errors:04X}"]
        return ",".join(flags + list(items)).encode() + b"\r\n"

    def _obey(self, words: list[str]) -> list[str]:
        """The data of the reply."""
        name, *arguments = [word.strip() for word in words]
        if name in ("RUNA", "RUNR", "RUNV") and len(arguments) == 1:
            return self._start(name, arguments[0])
        if name in ("STOP", "SSTOP", "ESTOP", "CLR") and not arguments:
            return self._act(name)
        if name in ("LP", "RUNA", "RUNR", "RUNV", "RUNH"):
            return ["-3 (Unable to get)"]
        if name not in self.values or len(arguments) > 1 or (arguments and name in READ_ONLY):
            return ["-102 (Argument count)"]
        if arguments:
            return self._set(name, arguments[0])
        if name == "VACT" and self.target is not None:
            self._look()
        return [self.values[name]]

    def _set(self, name: str, argument: str) -> list[str]:
        old = self.values[name]
        try:
            number = float(int(argument, 16) if argument.startswith("0X") else argument)
        except ValueError:
            return ["-101 (Argument type)"]
        if name == "MODE":
            self.values[name] = f"{int(number)} ({MODES[int(number)]})"
        else:
            self.values[name] = f"{number:.5E}" if "E" in old else str(int(number))
        return [self.values[name]]

    def _act(self, name: str) -> list[str]:
        if name == "CLR":
            self.errors = 0
        elif name == "ESTOP":
            self.errors |= EMERGENCY_STOP
        self.target, self.status = None, STANDBY
        self.values["VACT"] = "0.00000E+00"
        return []

    def _start(self, name: str, argument: str) -> list[str]:
        if self.errors:
            return ["-7 (Not possible when motor disabled)"]
        if not self.values["MODE"].startswith("2"):
            return ["-6 (Not possible in mode)"]
        if name == "RUNR" and self.target is not None:
            return ["-1 (Stop motor first)"]
        here = float(self.values["PACT"])
        way = {"+": 1e6, "-": -1e6}[argument] if name == "RUNV" else int(argument)
        self.target = way if name == "RUNA" else here + way
        self.looks = LOOKS
        self.status = 0
        self.values["VACT"] = "2.50000E+02" if self.target > here else "-2.50000E+02"
        # As in the manual's transcripts: RUNR alone answers something.
        return ["1"] if name == "RUNR" else []

    def _look(self):
        self.looks -= 1
        if self.looks < 0:
            self.values["PACT"] = f"{self.target:.5E}"
            self._act("arrived")

