"""How fluid the panel's page is: frames per second in headless Chromium while motors turn.

python bench/panel_fps.py STEPDRIVE, with the Python of the browser tests (tests/clients/panel.py) and Chromium. Frames are
counted by requestAnimationFrame for five seconds; sixty a second are the most there can be.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile
import urllib.request

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "tests" / "clients"))

from panel import chromium  # noqa: E402

# Drives, and how many of them move.
RIGS = [(10, 10), (1000, 10), (1000, 1000)]
SETTLE_MS = 3000
SECONDS = 5

# Frames in a second, and the longest wait for one in ms.
COUNT = """async (seconds) => {
  const times = [];
  await new Promise((done) => {
    const tick = (now) => {
      times.push(now);
      if (now - times[0] < seconds * 1000) requestAnimationFrame(tick);
      else done();
    };
    requestAnimationFrame(tick);
  });
  const waits = times.slice(1).map((time, place) => time - times[place]);
  return [waits.length / ((times.at(-1) - times[0]) / 1000), Math.max(...waits)];
}"""


def rig(drives: int) -> str:
    text = '[rig]\napi = "127.0.0.1:0"\n'
    for number in range(drives):
        text += f'[[drive]]\nname = "drive{number}"\nmodel = "SMSD-4.2LAN"\nmodbus_tcp = "127.0.0.1:0"\n'
        text += "[drive.mechanics]\ntravel = [-100000.0, 100000.0]\n"
    return text


def busy(session) -> float:
    """Seconds for which the page's own thread has worked since it was opened."""
    rows = session.send("Performance.getMetrics")["metrics"]
    return next(row["value"] for row in rows if row["name"] == "TaskDuration")


def measure(page, name: str, drives: int, moving: int):
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable")
    page.wait_for_timeout(SETTLE_MS)
    before = busy(session)
    rate, longest = page.evaluate(COUNT, SECONDS)
    share = (busy(session) - before) / SECONDS
    print(f"{drives:6}  {moving:6}  {name:14} {rate:8.1f} {longest:12.0f} {share:13.0%}", flush=True)


def start_motors(panel: str, moving: int):
    for number in range(moving):
        body = json.dumps({"direction": "+" if number % 2 else "-", "speed": 300, "override_trust": True}).encode()
        request = urllib.request.Request(f"{panel}v1/axes/drive{number}/run", body, {"Content-Type": "application/json"})
        urllib.request.urlopen(request).read()


def measure_rig(browser, panel: str, drives: int, moving: int):
    start_motors(panel, moving)
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    measure(page, "an empty page", drives, moving)
    for name, route in [("overview", "#/"), ("drive page", "#/axis/drive0/drive")]:
        page.goto(panel + route)
        page.wait_for_selector(".link:has-text('connected')")
        if name == "overview":
            page.wait_for_selector(f".chip[data-key=moving] .count:text-is('{moving}')")
        measure(page, name, drives, moving)


def main():
    print("drives  moving  page           frames/s  longest, ms  page is busy")
    for drives, moving in RIGS:
        with tempfile.TemporaryDirectory() as folder, chromium() as browser:
            (pathlib.Path(folder) / "rig.toml").write_text(rig(drives))
            command = [sys.argv[1], "up", f"{folder}/rig.toml", "--json", "--state", f"{folder}/state"]
            # What is remembered of positions stands in the state folder of the platform.
            environment = {**os.environ, "XDG_STATE_HOME": folder}
            server = subprocess.Popen(command, stdout=subprocess.PIPE, env=environment)
            try:
                measure_rig(browser, json.loads(server.stdout.readline())["panel"], drives, moving)
            finally:
                server.terminate()
                server.wait()


if __name__ == "__main__":
    main()
