"""A running `stepdrive up`."""

import json
import os
import pathlib
import select
import signal
import subprocess
import time

HOST = "127.0.0.1"
START_SECONDS = 10
STOP_SECONDS = 10

RIG = """\
[rig]
clock = "real"
[[drive]]
name = "stage"
model = "{model}"
modbus_tcp = "{host}:0"
[drive.motor]
steps_per_rev = 200
[drive.mechanics]
travel = [-2000.0, 2000.0]
start = 0.0
[[drive.switch]]
input = "SET_ZERO"
closed = [-120.0, -100.0]
[[drive.switch]]
input = "IN1"
closed = [300.0, 320.0]
"""


class Rig:
    """One controller named `stage`, in a folder that keeps its memory over restarts."""

    text = RIG

    def __init__(self, folder: pathlib.Path, model: str):
        self.model = model
        self.folder = folder
        self.port = 0
        self.process = None
        (folder / "rig.toml").write_text(self.text.format(model=model, host=HOST))

    def start(self):
        """Starts the process and waits until it says that it is ready, and where."""
        command = [os.environ["STEPDRIVE"], "up", str(self.folder / "rig.toml")]
        command += ["--json", "--state", str(self.folder / "state")]
        with open(self.folder / "stderr", "ab") as stderr:
            self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=stderr)
        ready = json.loads(self._first_line())
        assert ready["event"] == "ready"
        self._announced(ready)

    def _announced(self, ready):
        """Remembers what the ready line says."""
        (drive,) = ready["drives"]
        self._take(drive)

    def _take(self, drive):
        """Remembers where the drive says that it is reached."""
        assert (drive["name"], drive["model"]) == ("stage", self.model)
        host, port = drive["modbus_tcp"].rsplit(":", 1)
        assert host == HOST
        self.port = int(port)
        assert self.port != 0, "the ready line names the port that the rig listens on"

    def stop(self):
        """Ends the process as a person would; it must end well."""
        self.process.send_signal(signal.SIGTERM)
        assert self._ended() == 0, self.complaints()

    def restart(self):
        """Switches it off and on."""
        self.stop()
        self.start()

    def kill(self):
        """Ends the process without a chance to save anything."""
        self.process.kill()
        assert self._ended() == -signal.SIGKILL

    def is_running(self) -> bool:
        return self.process is not None and self.process.poll() is None

    def complaints(self) -> str:
        """What the process has said to the person at the terminal."""
        return (self.folder / "stderr").read_text(errors="replace")

    def clean_up(self):
        """Leaves no process behind, whatever happened."""
        if self.is_running():
            self.process.kill()
        if self.process is not None:
            self._ended()

    def _ended(self) -> int:
        code = self.process.wait(STOP_SECONDS)
        self.process.stdout.close()
        return code

    def _first_line(self) -> bytes:
        descriptor = self.process.stdout.fileno()
        deadline = time.monotonic() + START_SECONDS
        line = b""
        while not line.endswith(b"\n"):
            wait = max(0.0, deadline - time.monotonic())
            readable, _, _ = select.select([descriptor], [], [], wait)
            part = os.read(descriptor, 4096) if readable else b""
            assert part, f"no ready line, but {line!r}; it said: {self.complaints()}"
            line += part
        assert line.count(b"\n") == 1, "one line only"
        return line
