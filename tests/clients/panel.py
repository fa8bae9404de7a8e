"""The panel in a real browser: Debian's Chromium, driven by Playwright."""

import contextlib
import http.client
import json
import os
import pathlib
import signal
import subprocess
import time

import pytest
from playwright.sync_api import Page, expect, sync_playwright

from control import Control
from rig import HOST, Rig

# A drive that is told to brake stands long before.
STAND_SECONDS = 3

CHROMIUM = "/usr/bin/chromium"
# Without the flags of the network Chromium asks for hosts of its maker's; without a sandbox it runs as root, in CI.
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]

# Where screenshots are kept, to be looked at.
SHOTS = pathlib.Path(os.environ.get("PANEL_SHOTS", "target/panel"))

RIG = """\
[rig]
clock = "real"
api = "{host}:{api}"
[[drive]]
name = "stage"
model = "SMSD-4.2LAN"
modbus_tcp = "{host}:0"
usb = "pty"
[drive.mechanics]
travel = [-100.0, 1900.0]
start = 600.0
[[drive.switch]]
input = "SET_ZERO"
closed = [-100.0, 0.0]
[[drive.switch]]
input = "IN1"
closed = [1200.0, 1300.0]
[[drive]]
name = "uhv"
model = "SMD3"
serial_tcp = "{host}:0"
[drive.mechanics]
travel = [-2000.0, 2000.0]
[[drive.switch]]
input = "LIMIT_NEGATIVE"
closed = [-2000.0, -1900.0]
[[drive.switch]]
input = "LIMIT_POSITIVE"
closed = [1900.0, 2000.0]
"""


class PanelRig(Rig):
    """A rig of both families with its panel."""

    def __init__(self, folder: pathlib.Path, text: str = RIG):
        self.folder = folder
        self.process = None
        self.panel = ""
        self.drives = []
        self.port = 0
        (folder / "rig.toml").write_text(text.format(host=HOST, api=0))
        self.text = text

    def _announced(self, ready):
        self.panel = ready["panel"]
        self.drives = ready["drives"]
        self.control = Control(ready["api"])
        # Brought up again it is found where it was.
        port = ready["api"].rsplit(":", 1)[1]
        (self.folder / "rig.toml").write_text(self.text.format(host=HOST, api=port))

    def drive(self, name: str) -> dict:
        """A drive as its rig sees it, whatever the panel shows."""
        return self.control.get(f"/v1/drives/{name}")

    def post(self, path: str, body: dict):
        """Asks the panel for something, as its page would."""
        connection = http.client.HTTPConnection(self.panel.removeprefix("http://").rstrip("/"), timeout=10)
        with contextlib.closing(connection):
            connection.request("POST", path, json.dumps(body), {"Content-Type": "application/json"})
            reply = connection.getresponse()
            assert reply.status in (200, 202), reply.read()

    @contextlib.contextmanager
    def frozen(self):
        """The server says and hears nothing for a while, but its connections stand."""
        self.process.send_signal(signal.SIGSTOP)
        try:
            yield
        finally:
            self.process.send_signal(signal.SIGCONT)

    def speed(self, name: str) -> float:
        """The true speed of a drive, in full steps a second."""
        return self.drive(name)["speed"]


@contextlib.contextmanager
def chromium():
    """A browser for all tests of a module."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        try:
            yield browser
        finally:
            browser.close()


class Tab:
    """A person's look at the panel. What the page complains of in its console fails the test."""

    def __init__(self, browser, rig, **context):
        context.setdefault("viewport", {"width": 1280, "height": 900})
        self.context = browser.new_context(**context)
        self.rig = rig
        self.complaints = []
        self.page = self._new_page()

    def _new_page(self) -> Page:
        page = self.context.new_page()
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("console", self._heard)
        return page

    def _heard(self, message):
        # A refused request is told by the page itself; the browser's own line on it is no fault of the page.
        if message.type == "error" and "Failed to load resource" not in message.text:
            self.complaints.append(message.text)

    def open(self, route: str = "#/") -> Page:
        """Goes to a page of the panel, and waits until it is connected."""
        return self._go(self.page, route)

    def another(self, route: str = "#/") -> Page:
        """Opens a further tab of the same browser."""
        return self._go(self._new_page(), route)

    def _go(self, page: Page, route: str) -> Page:
        page.goto(self.rig.panel + route)
        expect(page.locator(".link")).to_have_text("connected", timeout=15_000)
        return page

    def shoot(self, name: str):
        """Keeps a picture of what is seen."""
        SHOTS.mkdir(parents=True, exist_ok=True)
        self.page.screenshot(path=SHOTS / f"{name}.png")

    def close(self):
        self.context.close()
        assert self.complaints == []


class RealPanel:
    """`stepdrive panel` on the stage of a rig, which it takes for a real drive: it knows only where that is."""

    MILLIMETRES = 'unit = "mm"\nper_turn = 5.0\nlimits = [-5, 40]\nsteps_per_rev = 200\n'

    def __init__(self, rig: PanelRig, unit: str = MILLIMETRES, port: int | str = 0):
        stage = rig.drives[0]["modbus_tcp"]
        axis = f'[axis.bench]\nuri = "smsd+tcp://{stage}"\n{unit}'
        (rig.folder / "stepdrive.toml").write_text(axis)
        command = [os.path.abspath(os.environ["STEPDRIVE"]), "panel", "--listen", f"{HOST}:{port}", "--json"]
        environment = {**os.environ, "XDG_STATE_HOME": str(rig.folder / "trust")}
        with open(rig.folder / "panel-stderr", "wb") as stderr:
            self.process = subprocess.Popen(
                command, cwd=rig.folder, env=environment, stdout=subprocess.PIPE, stderr=stderr
            )
        self.panel = json.loads(self.process.stdout.readline())["panel"]
        self.port = self.panel.rstrip("/").rsplit(":", 1)[1]

    def stop(self):
        """Ends it as a person would; it must end well."""
        self.process.terminate()
        assert self.process.wait(10) == 0
        self.process.stdout.close()


@pytest.fixture(scope="module")
def browser():
    with chromium() as browser:
        yield browser


@pytest.fixture
def rig(tmp_path):
    """A running rig of both families. It must still be running when the test is over, and end with 0."""
    rig = PanelRig(tmp_path)
    try:
        rig.start()
        yield rig
        assert rig.is_running(), rig.complaints()
        rig.stop()
    finally:
        rig.clean_up()


@pytest.fixture
def tabs(browser, rig):
    """Opens browsers of people who know nothing of each other."""
    opened = []

    def open_one(**context) -> Tab:
        tab = Tab(browser, rig, **context)
        opened.append(tab)
        return tab

    yield open_one
    for tab in opened:
        tab.close()


@pytest.fixture
def tab(tabs) -> Tab:
    return tabs()


def until(holds, what: str, seconds: float = STAND_SECONDS):
    """Waits until something holds of the drives."""
    deadline = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < deadline, what
        time.sleep(0.02)
