"""The page of a drive: what its head, mechanism, plot, moves and flags tell, and that they tell the truth."""

import json
import os
import pathlib
import re
import subprocess

import pytest
from playwright.sync_api import expect

from panel import RIG, PanelRig, RealPanel, Tab, browser, rig, tab, tabs, until  # noqa: F401
from rig import HOST

# A page that is looked at for the first time has many files to fetch, on a machine that does other things too.
SOON = 15_000

# Names that would lie on each other, were they all on one line.
CROWDED = """\
[rig]
clock = "real"
api = "{host}:{api}"
[[drive]]
name = "a-drive-with-quite-a-long-name"
model = "SMSD-4.2LAN"
modbus_tcp = "{host}:0"
[drive.mechanics]
travel = [-2000.0, 2000.0]
start = -1900.0
[[drive.switch]]
input = "SET_ZERO"
closed = [-2000.0, -1950.0]
[[drive.switch]]
input = "IN1"
closed = [-1900.0, -1880.0]
[[drive.switch]]
input = "CONTINUE"
closed = [-1800.0, -1750.0]
"""

REVERSED = """\
[axis.stage]
uri = "smsd+tcp://{stage}"
unit = "mm"
per_turn = 5.0
steps_per_rev = 200
reversed = true
limits = [-10, 12]
"""

# The texts of the mechanism that are seen, with their boxes.
LABELS = """(picture) => [...picture.querySelectorAll("text")]
    .filter((text) => text.checkVisibility())
    .map((text) => [text.textContent, text.getBoundingClientRect().toJSON()])"""


def place_of(part) -> float:
    """Where a part of the mechanism that moves is drawn."""
    return float(re.search(r"translate\(([-\d.]+)", part.get_attribute("transform"))[1])


def tick_of(page, value: int) -> float:
    """Where the scale has a value."""
    return float(page.locator(".m-number", has_text=re.compile(f"^{value}$")).get_attribute("x"))


def on_canvas(page, colour: str) -> list[int]:
    """The lines of the plot, from its top, in which a line of this colour of the page is seen."""
    return page.evaluate(
        """(name) => {
            const probe = document.createElement("i");
            probe.style.color = `var(${name})`;
            document.body.append(probe);
            const want = getComputedStyle(probe).color.match(/\\d+/g).map(Number);
            probe.remove();
            const canvas = document.querySelector(".plot canvas");
            // Right of the numbers, which have the same colours.
            const from = Math.ceil(canvas.width * 0.15);
            const { data, width, height } = canvas.getContext("2d").getImageData(from, 0, canvas.width - from, canvas.height);
            const near = (at) => want.every((part, channel) => Math.abs(data[at + channel] - part) < 24) && data[at + 3] > 200;
            const rows = [];
            for (let y = 0; y < height; y += 1) for (let x = 0; x < width; x += 1) if (near(4 * (y * width + x))) { rows.push(y); break; }
            return rows;
        }""",
        colour,
    )


def zero(page):
    """Takes a place 4 full steps from where the stage stood as zero: it moves first, so that its motor holds."""
    page.locator("#goal").fill("4 steps")
    page.locator("#move-by").click()
    expect(page.locator("#state")).to_have_text("holds", timeout=SOON)
    page.locator("#zero").click()
    expect(page.locator(".trust")).to_have_text("position trusted", timeout=SOON)
    page.locator("#goal").fill("")


def is_drawn_reversed(page):
    """A reversed axis at 10 mm is at its tick, and its limits are at theirs; its positive direction is to the right."""
    page.locator("#goal").fill("10 mm")
    page.locator("#move-to").click()
    expect(page.locator("#position")).to_have_text("10.000 mm", timeout=SOON)
    carriage = page.locator(".m-carriage")
    until(lambda: abs(place_of(carriage) - tick_of(page, 10)) < 1, "the carriage is not at the tick of its position")
    assert tick_of(page, 10) > tick_of(page, 0)
    pixels = (tick_of(page, 10) - tick_of(page, 0)) / 10
    limits = sorted(float(line.get_attribute("x1")) for line in page.locator(".m-limit").all())
    expected = [tick_of(page, 0) + limit * pixels for limit in (-10, 12)]
    assert limits == pytest.approx(expected, abs=1)
    page.locator("#goal").fill("-5 mm")
    page.locator("#speed").fill("2 mm/s")
    page.locator("#move-to").click()
    expect(page.locator(".m-target")).to_be_visible()
    assert place_of(page.locator(".m-target")) == pytest.approx(tick_of(page, 0) - 5 * pixels, abs=1)
    page.locator("#stop").click()


class Panel(RealPanel):
    """`stepdrive panel` for the axes of a stepdrive.toml."""

    def __init__(self, folder: pathlib.Path, axes: str):
        (folder / "stepdrive.toml").write_text(axes)
        command = [os.path.abspath(os.environ["STEPDRIVE"]), "panel", "--listen", f"{HOST}:0", "--json"]
        environment = {**os.environ, "XDG_STATE_HOME": str(folder / "trust")}
        with open(folder / "panel-stderr", "wb") as stderr:
            self.process = subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=stderr)
        self.panel = json.loads(self.process.stdout.readline())["panel"]


@pytest.fixture
def panels(browser, tmp_path):
    """Opens panels for axes that a stepdrive.toml describes, each in a browser."""
    opened = []

    def open_one(axes: str) -> Tab:
        panel = Panel(tmp_path, axes)
        opened.append(panel)
        opened.append(Tab(browser, panel))
        return opened[-1]

    yield open_one
    for last in reversed(opened):
        last.stop() if isinstance(last, Panel) else last.close()


def test_a_reversed_real_axis_is_drawn_at_the_tick_of_its_position(panels, rig):
    tab = panels(REVERSED.format(stage=rig.drives[0]["modbus_tcp"]))
    page = tab.open("#/axis/stage")
    zero(page)
    is_drawn_reversed(page)
    tab.shoot("reversed-real")


def test_a_reversed_virtual_axis_is_drawn_with_its_switches_where_they_close(browser, tmp_path, monkeypatch):
    monkeypatch.setenv("STEPDRIVE", os.path.abspath(os.environ["STEPDRIVE"]))
    monkeypatch.chdir(tmp_path)
    rig = PanelRig(tmp_path)
    try:
        rig.start()
        stage = rig.drives[0]["modbus_tcp"]
        # Its address must be known beforehand for the file to name it.
        rig.stop()
        rig.text = RIG.replace('modbus_tcp = "{host}:0"', f'modbus_tcp = "{stage}"', 1)
        (tmp_path / "rig.toml").write_text(rig.text.format(host=HOST, api=0))
        (tmp_path / "stepdrive.toml").write_text(REVERSED.format(stage=stage))
        rig.start()
        tab = Tab(browser, rig)
        page = tab.open("#/axis/stage")
        zero(page)
        is_drawn_reversed(page)
        tab.shoot("reversed-virtual")
        # IN1 is closed from 1200 to 1300 full steps of a travel on which zero is at 596: -15.1 to -17.6 mm.
        switch = page.locator(".m-switch").nth(1)
        left = float(switch.get_attribute("x"))
        pixels = (tick_of(page, 10) - tick_of(page, 0)) / 10
        assert left == pytest.approx(tick_of(page, 0) - 17.6 * pixels, abs=1)
        assert float(switch.get_attribute("width")) == pytest.approx(2.5 * pixels, abs=1)
        tab.close()
        rig.stop()
    finally:
        rig.clean_up()


def test_a_drive_that_never_answered_is_told_so_and_no_mechanism_is_made_up(panels):
    # Nothing listens on the discard port here.
    tab = panels(f'[axis.dead]\nuri = "smsd+tcp://{HOST}:9"\n')
    page = tab.open("#/axis/dead")
    expect(page.locator("#age")).to_have_text("never answered", timeout=SOON)
    expect(page.locator("#state")).to_contain_text("lost")
    expect(page.locator(".trust")).to_contain_text("never answered")
    expect(page.locator("#position")).to_have_text("–")
    expect(page.locator(".m")).to_have_count(0)
    expect(page.get_by_role("button", name="HiZ, not known")).to_be_visible(timeout=SOON)
    tab.shoot("never-answered")


def test_steps_that_a_stall_loses_are_told_until_the_counter_is_set_right(tab, rig):
    page = tab.open("#/axis/stage")
    zero(page)
    carriage, ghost = page.locator(".m-carriage"), page.locator(".m-ghost")
    expect(ghost).to_be_hidden()
    stood = place_of(carriage)
    rig.control.do("fault stage.rotor blocked")
    page.locator("#goal").fill("400")
    page.locator("#move-to").click()
    expect(page.locator("#state")).to_have_text("stalled", timeout=SOON)
    expect(page.locator("#position")).to_have_text("400.00 steps", timeout=SOON)
    rig.control.do("fault stage.rotor off")
    expect(page.locator("#state")).to_have_text("holds", timeout=SOON)
    expect(page.locator("#lost-steps")).to_have_text("400 steps lost")
    expect(page.locator(".trust")).to_contain_text("400 steps off")
    # The rotor has not moved, the count has, and the scale stands.
    assert place_of(carriage) == pytest.approx(stood, abs=1)
    assert place_of(ghost) == pytest.approx(tick_of(page, 400), abs=1)
    tab.shoot("steps-lost")
    # Another part of its page knows it too.
    page.get_by_role("tab", name="Settings").click()
    expect(page.locator("#lost-steps")).to_have_text("400 steps lost")
    page.get_by_role("tab", name="Drive").click()
    page.locator("#zero").click()
    expect(page.locator("#lost-steps")).to_have_text("")
    expect(ghost).to_be_hidden()
    expect(page.locator(".trust")).to_have_text("position trusted")


def test_homing_makes_good_for_steps_that_were_lost(tab, rig):
    page = tab.open("#/axis/stage")
    rig.control.do("fault stage.rotor blocked")
    page.locator("#goal").fill("200")
    page.locator("#move-by").click()
    expect(page.locator("#lost-steps")).to_have_text("200 steps lost", timeout=SOON)
    rig.control.do("fault stage.rotor off")
    page.locator("#speed").fill("1000")
    page.locator("#home").click()
    expect(page.locator(".trust")).to_have_text("position trusted", timeout=SOON)
    expect(page.locator("#lost-steps")).to_have_text("")


def test_a_program_that_runs_is_told_in_the_head_and_leads_to_programs(tab, rig):
    page = tab.open("#/axis/stage/programs")
    page.locator("#program-text").fill("    MOVE_F 40\n    SET_WAIT 60s\n    END\n")
    expect(page.locator("#verdict")).to_contain_text("Good", timeout=SOON)
    page.locator("#store").click()
    expect(page.locator(".notice.good")).to_be_visible(timeout=SOON)
    page.locator("#start").click()
    page.get_by_role("tab", name="Drive").click()
    expect(page.locator("#program-runs")).to_have_text(re.compile(r"program mem0:\d+ runs"), timeout=SOON)
    tab.shoot("program-in-head")
    page.locator("#program-runs").click()
    expect(page.get_by_role("tab", name="Programs")).to_have_attribute("aria-selected", "true")
    page.locator("#stop").click()
    expect(page.locator("#program-runs")).to_be_hidden(timeout=SOON)


def test_an_smd3_homes_only_with_its_limits_on_and_its_begin_and_end_are_told(tab, rig):
    page = tab.open("#/axis/uhv")
    expect(page.locator("#home")).to_be_disabled(timeout=SOON)
    expect(page.locator("#home-why")).to_contain_text("L is 0")
    expect(page.locator("#home-why").get_by_role("link")).to_have_attribute("href", "#/axis/uhv/bake")
    tab.shoot("home-disabled")
    answer = page.request.put(f"{rig.panel}v1/axes/uhv/settings", data={"set": {"L": "1"}})
    assert answer.ok, answer.text()
    expect(page.locator("#home")).to_be_enabled(timeout=SOON)
    expect(page.locator("#home-why")).to_be_hidden()
    page.locator("#speed").fill("1000")
    page.locator("#home").click()
    expect(page.locator(".notice.good", has_text="looks for home")).to_be_visible(timeout=SOON)
    expect(page.locator(".notice.good", has_text="uhv is home")).to_be_visible(timeout=SOON)


def test_a_homing_that_is_refused_is_not_told_as_begun(tab, rig):
    page = tab.open("#/axis/stage")
    rig.control.do("fault stage.rotor blocked")
    page.locator("#speed").fill("99999")
    page.locator("#home").click()
    expect(page.locator(".notice.error")).to_be_visible(timeout=SOON)
    expect(page.locator(".notice.good")).to_have_count(0)


def test_a_fault_is_told_in_words_with_its_clearing_beside_it(tab, rig):
    page = tab.open("#/axis/uhv")
    expect(page.locator("#state")).to_have_text("holds", timeout=SOON)
    expect(page.locator("#clear-fault")).to_be_hidden()
    rig.control.do("fault uhv.thermocouple open")
    expect(page.locator("#state")).to_have_text("fault: TOPEN, sensor open", timeout=SOON)
    tab.shoot("fault-in-head")
    rig.control.do("fault uhv.thermocouple off")
    page.locator("#clear-fault").click()
    expect(page.locator("#state")).to_have_text("holds", timeout=SOON)


def test_time_that_is_not_real_is_told_beside_virtual_and_leads_to_the_rig(tab, rig):
    page = tab.open("#/axis/stage")
    expect(page.locator("#position")).to_contain_text("steps", timeout=SOON)
    time = page.locator("#rig-clock")
    expect(time).to_be_hidden()
    rig.control.clock("x10")
    expect(time).to_have_text("time x10", timeout=SOON)
    rig.control.clock("paused")
    expect(time).to_have_text("time paused", timeout=SOON)
    tab.shoot("paused")
    time.click()
    expect(page.locator("#rig-time")).to_be_visible(timeout=SOON)
    rig.control.clock("real")


def test_what_a_move_would_do_is_told_at_its_button_and_a_mistake_once_at_its_field(tab):
    page = tab.open("#/axis/stage")
    zero(page)
    preview, wrong = page.locator("#preview"), page.locator("#goal-error")
    expect(preview).to_be_hidden()
    page.locator("#goal").fill("300")
    expect(preview).to_have_text(re.compile(r"^→ 300\.00, \d+\.\d\d s→ 300\.00, \d+\.\d\d s$"), timeout=SOON)
    page.locator("#goal").fill("30 s")
    expect(wrong).to_contain_text("unit `s` is unknown", timeout=SOON)
    expect(page.locator("#goal")).to_have_attribute("aria-invalid", "true")
    expect(preview).to_be_hidden()
    page.locator("#goal").fill("30")
    page.locator("#speed").fill("-5")
    expect(wrong).to_contain_text("a speed is above 0", timeout=SOON)
    expect(page.locator("#speed")).to_have_attribute("aria-invalid", "true")
    expect(page.locator("#goal")).not_to_have_attribute("aria-invalid", "true")
    page.locator("#speed").fill("")
    expect(wrong).to_have_text("")
    expect(preview).to_be_visible()
    page.locator("#goal").fill("")
    expect(preview).to_be_hidden()
    page.locator("#move-to").click()
    expect(wrong).to_contain_text("Say where to")


def test_a_preview_never_says_that_nothing_was_sent(tab):
    page = tab.open("#/axis/stage")
    page.locator("#goal").fill("300")
    expect(page.locator("#preview")).to_contain_text("not while it is not trusted", timeout=SOON)
    expect(page.locator("#preview")).not_to_contain_text("nothing was sent")
    page.locator("#override").check()
    expect(page.locator("#preview")).not_to_contain_text("trusted", timeout=SOON)


def test_position_and_speed_never_lie_on_each_other_and_their_last_values_are_told(tab):
    page = tab.open("#/axis/stage")
    legend = page.locator(".legend")
    expect(legend).to_contain_text("position 0.00 steps", timeout=SOON)
    expect(legend).to_contain_text("speed 0.00 steps/s")
    until(lambda: on_canvas(page, "--plot-position") and on_canvas(page, "--plot-speed"), "a line is missing", 15)
    assert max(on_canvas(page, "--plot-position")) < min(on_canvas(page, "--plot-speed"))
    page.locator("#goal").fill("300")
    page.locator("#move-by").click()
    expect(legend).to_contain_text("position 300.00 steps", timeout=SOON)
    assert max(on_canvas(page, "--plot-position")) < min(on_canvas(page, "--plot-speed"))


def test_a_zoom_is_undone_by_a_button_that_is_there_only_while_there_is_one(tab):
    page = tab.open("#/axis/stage")
    expect(page.locator(".legend")).to_contain_text("position 0.00", timeout=SOON)
    whole, pause = page.locator("#plot-reset"), page.locator("#plot-pause")
    expect(whole).to_be_hidden()
    box = page.locator(".u-over").bounding_box()
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + box["width"] * 0.5, middle)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] * 0.9, middle, steps=5)
    page.mouse.up()
    expect(whole).to_be_visible()
    expect(pause).to_have_text("Resume")
    tab.shoot("zoomed")
    whole.click()
    expect(whole).to_be_hidden()
    pause.click()
    expect(pause).to_have_text("Pause")


@pytest.mark.parametrize("control", ["slider", "list"])
def test_the_arrow_keys_jog_again_after_a_pointer_has_used(tab, rig, control):
    page = tab.open("#/axis/stage")
    expect(page.locator("#position")).to_contain_text("steps", timeout=SOON)
    if control == "slider":
        page.locator("#jog-speed").click(position={"x": 40, "y": 5})
    else:
        page.locator("#plot-window").click()
        page.locator("#plot-window").select_option("10")
    page.keyboard.down("ArrowRight")
    until(lambda: rig.speed("stage") > 20, f"the {control} has kept the arrow keys", 10)
    page.keyboard.up("ArrowRight")
    until(lambda: rig.speed("stage") == 0, "the stage went on")


def test_a_slider_that_is_used_by_keys_keeps_them(tab):
    page = tab.open("#/axis/stage")
    page.locator("#jog-speed").focus()
    page.keyboard.press("ArrowRight")
    expect(page.locator("#jog-speed")).to_have_value("51")
    expect(page.locator("#jog-speed")).to_be_focused()


def test_lights_tell_apart_what_is_free_what_stands_and_what_turns(tab):
    page = tab.open("#/axis/stage")

    def sign(name: str) -> str:
        light = page.get_by_role("button", name=f"{name}, on", exact=True).first
        expect(light).to_be_visible(timeout=SOON)
        return light.evaluate("(light) => getComputedStyle(light, '::before').content")

    signs = {sign("HiZ"), sign("STOP"), sign("READY")}
    page.locator("#speed").fill("200")
    page.locator("#run-back").click()
    signs.add(sign("CONST_SPEED"))
    assert len(signs) == 4
    page.locator("#stop").click()


def test_a_flag_and_an_input_of_one_name_have_a_light_each(tab):
    page = tab.open("#/axis/stage")
    status, inputs = page.get_by_role("group", name="Status"), page.get_by_role("group", name="Inputs")
    # The last direction was forward, and nothing is at the input.
    expect(status.get_by_role("button", name="DIR, on", exact=True)).to_be_visible(timeout=SOON)
    expect(inputs.get_by_role("button", name="DIR, off", exact=True)).to_be_visible()


def test_a_finger_reads_what_a_flag_means_and_is_done_with_it_elsewhere(tabs):
    tab = tabs(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    page = tab.open("#/axis/stage")
    light = page.get_by_role("button", name="HiZ, on", exact=True)
    light.scroll_into_view_if_needed(timeout=SOON)
    light.tap()
    tip = page.get_by_role("tooltip")
    expect(tip).to_contain_text("The motor's phases are de-energised.")
    expect(tip).to_contain_text("manual")
    expect(tip).not_to_contain_text("docs/")
    box = tip.bounding_box()
    assert box["x"] >= 0 and box["x"] + box["width"] <= 390, box
    tab.shoot("telephone-flag")
    page.locator(".flags-card h2").tap()
    expect(tip).to_have_count(0)


@pytest.mark.parametrize("width", [390, 1280])
def test_names_are_whole_and_no_label_of_the_mechanism_lies_on_another(browser, tmp_path, width):
    rig = PanelRig(tmp_path, CROWDED)
    try:
        rig.start()
        tab = Tab(browser, rig, viewport={"width": width, "height": 844})
        page = tab.open("#/axis/a-drive-with-quite-a-long-name")
        expect(page.locator(".m")).to_contain_text("CONTINUE", timeout=SOON)
        labels = page.locator(".m").evaluate(LABELS)
        assert len(labels) > 6
        for at, (one, a) in enumerate(labels):
            for other, b in labels[at + 1:]:
                beside = a["right"] <= b["left"] or b["right"] <= a["left"]
                # The box of a text has some air above and below its letters.
                below = a["bottom"] <= b["top"] + 2 or b["bottom"] <= a["top"] + 2
                assert beside or below, f"{one} and {other} lie on each other"
        head = page.locator(".axis-head")
        assert page.locator("h1").evaluate("(name) => name.scrollWidth <= name.clientWidth"), "the name is cut"
        assert head.bounding_box()["height"] < 170
        tab.shoot(f"crowded-{width}")
        tab.close()
        rig.stop()
    finally:
        rig.clean_up()


def test_the_parts_of_a_drives_page_name_what_they_show(tab, rig):
    page = tab.open("#/axis/stage")
    tabs = page.get_by_role("tab")
    expect(tabs.first).to_be_visible()
    panel = page.get_by_role("tabpanel").get_attribute("id")
    assert {one.get_attribute("aria-controls") for one in tabs.all()} == {panel}
