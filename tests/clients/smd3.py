"""An SMD3 as pyserial sees it, and a running rig that has one."""

import time

import serial

from rig import Rig

WAIT_SECONDS = 10
POLL_SECONDS = 0.002

# Status flags
LIMIT_NEGATIVE, LIMIT_POSITIVE, IDENT, STANDBY, BAKE, ATSPEED = 0x02, 0x04, 0x10, 0x40, 0x80, 0x100
# Error flags
EMERGENCY_STOP, CONFIGURATION_ERROR = 0x20, 0x40

RIG = """\
[[drive]]
name = "uhv"
model = "SMD3"
serial = "pty"
serial_tcp = "{host}:0"
[drive.mechanics]
travel = [-1000.0, 1000.0]
[[drive.switch]]
input = "LIMIT_NEGATIVE"
closed = [-1000.0, -400.0]
[[drive.switch]]
input = "LIMIT_POSITIVE"
closed = [400.0, 1000.0]
[drive.winding]
ambient = 21.0
time_constant = 0.2
rise = 300.0
"""


class Smd3Rig(Rig):
    """One SMD3 named `uhv`, in a folder that keeps its memory over restarts."""

    text = RIG

    def __init__(self, folder):
        super().__init__(folder, "SMD3")
        self.serial = self.serial_tcp = ""

    def _take(self, drive):
        assert (drive["name"], drive["model"]) == ("uhv", "SMD3")
        assert "modbus_tcp" not in drive
        self.serial, self.serial_tcp = drive["serial"], drive["serial_tcp"]

    def url(self, transport: str) -> str:
        """What pyserial opens: a device, or lines over TCP."""
        return self.serial if transport == "pty" else f"socket://{self.serial_tcp}"


class Reply:
    """A reply taken apart, as a script written for the real drive would."""

    def __init__(self, line: bytes):
        assert line.endswith(b"\r\n"), f"no whole reply in time, but {line!r}"
        self.text = line[:-2].decode("ascii")
        sflags, eflags, *data = self.text.split(",", 2)
        self.sflags, self.eflags = int(sflags, 0), int(eflags, 0)
        self.data = data[0] if data else None

    def has(self, flag: int) -> bool:
        return self.sflags & flag != 0


class Smd3:
    """A drive at the other end of a serial port."""

    def __init__(self, url: str):
        self.port = serial.serial_for_url(url, baudrate=115200, timeout=5)
        self.transactions = 0

    def ask(self, line: str) -> Reply:
        """Sends a line and gives back the reply."""
        self.port.write(line.encode("ascii") + b"\r\n")
        self.transactions += 1
        return Reply(self.port.read_until(b"\r\n"))

    def do(self, line: str) -> Reply:
        """Sends a command that is answered with the flags alone."""
        reply = self.ask(line)
        assert reply.data is None, f"{line}: {reply.text}"
        return reply

    def get(self, line: str) -> float:
        """Reads or sets a number, and gives back what it is now."""
        return float(self.ask(line).data)

    def wait(self, flag: int, on=True) -> Reply:
        """Asks for nothing but the flags until one of them is on, or off."""
        deadline = time.monotonic() + WAIT_SECONDS
        while (reply := self.ask("")).has(flag) != on:
            assert time.monotonic() < deadline, f"flag {flag:#x} is not {on}: {reply.text}"
            time.sleep(POLL_SECONDS)
        return reply

    def wait_until(self, line: str, reached):
        """Reads a number until it is what is wanted."""
        deadline = time.monotonic() + WAIT_SECONDS
        while not reached(value := self.get(line)):
            assert time.monotonic() < deadline, f"{line} is {value}"
            time.sleep(POLL_SECONDS)

    def close(self):
        self.port.close()
