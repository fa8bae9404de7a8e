"""A rig under control: its clock, its signals and its faults over the HTTP API, and clients of its drives."""

import contextlib
import http.client
import json
import pathlib

from controller import Pymodbus
from rig import HOST, Rig
from smd3 import Smd3

SECOND_NS = 1_000_000_000
REPLY_SECONDS = 10

RIG = """\
[rig]
clock = "paused"
api = "{host}:0"
[[drive]]
name = "a"
model = "SMSD-4.2LAN"
modbus_tcp = "{host}:0"
[drive.mechanics]
travel = [-2000.0, 2000.0]
[[drive.switch]]
input = "IN1"
closed = [300.0, 320.0]
[[drive.switch]]
input = "SW"
closed = [100.0, 110.0]
[[drive]]
name = "b"
model = "SMSD-8.0LAN"
modbus_tcp = "{host}:0"
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
[[wire]]
from = "a.relay"
to = "b.CONTINUE"
delay = "5ms"
"""


class Control:
    """The control API, by the client of Python's own library."""

    def __init__(self, url: str):
        assert url.startswith("http://")
        self.connection = http.client.HTTPConnection(url.removeprefix("http://"), timeout=REPLY_SECONDS)

    def close(self):
        self.connection.close()

    def get(self, path: str):
        return self._ask("GET", path)

    def do(self, *actions: str):
        """Carries out actions, as in `input a.IN0 1`."""
        self._ask("POST", "/v1/actions", {"do": actions})

    def clock(self, mode: str) -> int:
        """Sets the clock; returns the rig time, in nanoseconds."""
        return self._ask("PUT", "/v1/clock", {"mode": mode})["now_ns"]

    def now(self) -> int:
        """The rig time, in nanoseconds."""
        return self.get("/v1/rig")["now_ns"]

    def step(self, time: str) -> int:
        """Moves rig time on, and returns it."""
        return self._ask("POST", "/v1/clock/step", {"for": time})["now_ns"]

    def run_until(self, until: str, within: str = "1min") -> int:
        """Moves rig time on to what must come about within that time, and returns it."""
        ran = self._ask("POST", "/v1/clock/run-until", {"until": until, "within": within})
        assert ran["reached"], f"{until} did not come about within {within} of rig time"
        return ran["now_ns"]

    def comes_about(self, until: str, within: str) -> bool:
        """Moves rig time on; returns whether it came about."""
        return self._ask("POST", "/v1/clock/run-until", {"until": until, "within": within})["reached"]

    def drive(self, name: str) -> dict:
        return self.get(f"/v1/drives/{name}")

    def carriage(self, name: str) -> float:
        """Where the carriage is on its travel, in full steps."""
        return self.drive(name)["carriage"]

    def faults(self, name: str) -> dict:
        """What is wrong with a drive: settings by name."""
        return self.drive(name)["faults"]

    def _ask(self, method: str, path: str, body=None):
        headers = {} if body is None else {"Content-Type": "application/json"}
        self.connection.request(method, path, body=body and json.dumps(body), headers=headers)
        reply = self.connection.getresponse()
        answer = json.load(reply)
        assert reply.status == 200, f"{method} {path} {body}: {reply.status} {answer}"
        return answer


class ControlledRig(Rig):
    """Two SMSDs, `a` whose relay is wired to the CONTINUE of `b`, and the SMD3 `uhv`; its clock is paused."""

    text = RIG

    def __init__(self, folder: pathlib.Path):
        super().__init__(folder, "")
        self.control = None
        self.drives = {}
        self.opened = []

    def _announced(self, ready):
        self.drives = {drive["name"]: drive for drive in ready["drives"]}
        self.control = self._opened(Control(ready["api"]))

    def modbus(self, name: str) -> Pymodbus:
        """A connection to an SMSD."""
        host, port = self.drives[name]["modbus_tcp"].rsplit(":", 1)
        assert host == HOST
        return self._opened(Pymodbus(int(port)))

    def logged_in(self, name: str) -> Pymodbus:
        """A connection to an SMSD that is logged in, with the drive parameters of short moves."""
        client = self.modbus(name)
        client.log_in()
        client.set_drive()
        return client

    def serial(self, transport: str = "tcp") -> Smd3:
        """A connection to the SMD3, over its port or over TCP."""
        drive = self.drives["uhv"]
        return self._opened(Smd3(drive["serial"] if transport == "pty" else f"socket://{drive['serial_tcp']}"))

    def _opened(self, client):
        self.opened.append(client)
        return client

    def close_clients(self):
        for client in self.opened:
            client.close()


@contextlib.contextmanager
def running(folder: pathlib.Path):
    """A running rig. It must still be running at the end, and end with 0."""
    rig = ControlledRig(folder)
    try:
        rig.start()
        yield rig
        assert rig.is_running(), rig.complaints()
        rig.stop()
    finally:
        rig.close_clients()
        rig.clean_up()


def be_impatient(client: Pymodbus, seconds: float):
    """Lets pymodbus wait no longer than that for a reply."""
    client.client.comm_params.timeout_connect = seconds
