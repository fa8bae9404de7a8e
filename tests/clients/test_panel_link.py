"""What stands between a page and its drives: streams, stops that do not get through, tabs, addresses and notices."""

import contextlib
import http.client
import re

import pytest
from playwright.sync_api import expect

from panel import RIG, PanelRig, RealPanel, Tab, browser, rig, tab, tabs, until  # noqa: F401

# Pages of a headless browser are never hidden by themselves.
HIDES = "window.isHidden = false; Object.defineProperty(document, 'hidden', { get: () => window.isHidden });"
LOOKS = "(looks) => { window.isHidden = !looks; document.dispatchEvent(new Event('visibilitychange')); }"
# Keeps all that an element ever said.
LISTENS = """(element) => {
    window.said = [element.textContent];
    new MutationObserver(() => window.said.push(element.textContent)).observe(element, { childList: true, characterData: true, subtree: true });
}"""
# How well the text of an element is told from its ground, by WCAG 2.
CONTRAST = """(element) => {
    const light = (colour) => colour.match(/[\\d.]+/g).slice(0, 3).map((part) => part / 255)
        .map((part) => (part <= 0.03928 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4))
        .reduce((sum, part, at) => sum + part * [0.2126, 0.7152, 0.0722][at], 0);
    const { color, backgroundColor } = getComputedStyle(element);
    const [dark, bright] = [light(color), light(backgroundColor)].sort((a, b) => a - b);
    return (bright + 0.05) / (dark + 0.05);
}"""
# Which stops lie under a notice.
COVERED = """() => [...document.querySelectorAll("button.stop")].filter((button) => {
    const one = button.getBoundingClientRect();
    return [...document.querySelectorAll("#notices > *")].some((note) => {
        const other = note.getBoundingClientRect();
        return other.width > 0 && one.left < other.right && other.left < one.right && one.top < other.bottom && other.top < one.bottom;
    });
}).length"""
OPACITY = """(element) => {
    let opacity = 1;
    for (let at = element; at; at = at.parentElement) opacity *= Number(getComputedStyle(at).opacity);
    return opacity;
}"""


def run(rig, name: str = "stage", speed: str = "200"):
    rig.post(f"/v1/axes/{name}/run", {"direction": "+", "speed": speed})
    until(lambda: rig.speed(name) > 50, f"{name} never ran")


def test_a_tab_that_was_hidden_behind_another_goes_on_when_it_is_looked_at(tab, rig):
    tab.context.add_init_script(HIDES)
    page = tab.open("#/axis/stage")
    expect(page.locator(".m-carriage")).to_be_visible()
    page.evaluate(LOOKS, False)
    other = tab.another("#/axis/stage")
    expect(page.locator(".link")).to_have_text("connection lost")
    other.close()
    page.evaluate(LOOKS, True)
    expect(page.locator(".link")).to_have_text("connected", timeout=10_000)
    before = page.locator(".m-carriage").get_attribute("transform")
    rig.post("/v1/axes/stage/move", {"by": 150})
    expect(page.locator("#position")).to_have_text("150.00 steps", timeout=10_000)
    expect(page.locator(".m-carriage")).not_to_have_attribute("transform", before)


def test_a_stop_gets_through_though_streams_take_every_connection_that_a_browser_has(tab, rig):
    page = tab.open("#/axis/stage")
    run(rig)
    for _ in range(2):
        expect(tab.another("#/axis/stage").locator(".m-carriage")).to_be_visible(timeout=15_000)
    page.locator("#stop").click()
    until(lambda: rig.speed("stage") == 0, "it was not stopped by a tab among others", 10)
    for other in tab.context.pages:
        expect(other.locator(".link")).to_have_text("connected", timeout=15_000)


def test_a_server_that_falls_silent_is_seen_at_once_and_its_stop_is_confirmed_when_it_wakes(tab, rig):
    page = tab.open("#/axis/stage")
    run(rig)
    page.locator(".link").evaluate(LISTENS)
    with rig.frozen():
        expect(page.locator(".link")).to_have_text(re.compile("not live|connection lost"), timeout=10_000)
        expect(page.locator("#link-age")).to_have_text(re.compile(r"\d s old"))
        assert page.locator("#stop").evaluate(OPACITY) == 1
        page.locator("#stop").click()
        note = page.locator(".notice.error")
        expect(note).to_contain_text("STOP of stage is not confirmed yet", timeout=5_000)
        tab.shoot("not-live")
        # However often it is tried, one notice says so.
        expect(page.locator(".link")).to_have_text("connection lost", timeout=10_000)
        expect(note).to_have_count(1)
    assert "not live" in page.evaluate("window.said")
    expect(page.locator(".notice.good")).to_contain_text("STOP of stage is confirmed", timeout=15_000)
    expect(note).to_have_count(0)
    until(lambda: rig.speed("stage") == 0, "the stop was never told")
    expect(page.locator(".link")).to_have_text("connected", timeout=10_000)


def test_a_drive_that_was_lost_before_the_page_came_is_counted_and_found(tab, rig):
    page = tab.open()
    expect(page.locator('.chip[data-key="rest"] .count')).to_have_text("2")
    rig.control.do("power stage off")
    lost = page.locator('.chip[data-key="lost"]')
    expect(lost.locator(".count")).to_have_text("1", timeout=10_000)
    page.reload()
    expect(lost.locator(".count")).to_have_text("1", timeout=10_000)
    lost.click()
    expect(page.get_by_role("article")).to_have_count(1)
    expect(page.get_by_role("article", name="stage")).to_contain_text("lost, last seen")
    tab.shoot("overview-lost")
    page.get_by_role("link", name="stage").click()
    expect(page.locator("#state")).to_contain_text("lost")
    assert page.locator("#stop").evaluate(OPACITY) == 1, "a stop never looks as if it could not be pressed"


def test_a_drive_that_never_answered_is_lost_and_said_to_be_so(browser, rig):
    rig.control.do("power stage off")
    real = RealPanel(rig)
    tab = Tab(browser, real)
    page = tab.open()
    expect(page.locator('.chip[data-key="lost"] .count')).to_have_text("1", timeout=15_000)
    expect(page.get_by_role("article", name="bench")).to_contain_text("lost, never answered")
    tab.close()
    real.stop()


def test_who_could_not_be_told_to_stop_is_named_until_they_have_been(tab, rig):
    page = tab.open()
    expect(page.locator('.chip[data-key="rest"] .count')).to_have_text("2")
    rig.control.do("power stage off")
    expect(page.locator('.chip[data-key="lost"] .count')).to_have_text("1", timeout=10_000)
    page.locator("#stop-all").click()
    left = page.locator(".notice.stays", has_text="stage could not be told to stop yet")
    expect(left).to_be_visible(timeout=10_000)
    tab.shoot("not-told")
    rig.control.do("power stage on")
    expect(page.locator(".notice.good")).to_contain_text("stage can be reached again, and stands", timeout=20_000)
    expect(left).to_have_count(0)


@contextlib.contextmanager
def many(browser, folder, count):
    """A tab that looks at many drives."""
    drive = '[[drive]]\nname = "d{}"\nmodel = "SMSD-4.2LAN"\nmodbus_tcp = "{{host}}:0"\n'
    rig = PanelRig(folder, '[rig]\napi = "{host}:{api}"\n' + "".join(drive.format(number) for number in range(count)))
    try:
        rig.start()
        tab = Tab(browser, rig)
        yield tab
        tab.close()
        rig.stop()
    finally:
        rig.clean_up()


def test_hundreds_of_drives_that_move_are_stopped_by_one_word(browser, tmp_path):
    with many(browser, tmp_path, 300) as tab:
        page, rig = tab.open(), tab.rig
        for number in range(300):
            rig.post(f"/v1/axes/d{number}/run", {"direction": "+", "speed": 100})
        expect(page.locator('.chip[data-key="moving"] .count')).to_have_text("300", timeout=30_000)
        asked = []
        page.on("request", lambda request: asked.append(request.url) if request.url.endswith("/stop") else None)
        page.locator("#stop-all").click()
        stand = lambda: all(drive["speed"] == 0 for drive in rig.control.get("/v1/rig")["drives"])
        until(stand, "some go on", 20)
        assert asked == [f"{rig.panel}v1/axes/stop"]


def test_many_drives_are_a_table_that_is_found_scrolled_as_it_was_left(browser, tmp_path):
    with many(browser, tmp_path, 60) as tab:
        page = tab.open()
        expect(page.locator('.chip[data-key="rest"] .count')).to_have_text("60", timeout=10_000)
        page.locator(".view").evaluate("(view) => view.scrollTo(0, 1000)")
        row = page.locator(".drive-row", has=page.get_by_role("link", name="d25", exact=True))
        numbers = row.locator(".number").first.bounding_box()
        head = page.get_by_role("columnheader", name="Position").bounding_box()
        assert abs(numbers["x"] + numbers["width"] - head["x"] - head["width"]) < 2, "the head stands over its numbers"
        tab.shoot("table")
        row.locator(".word").click()
        expect(page.locator("#position")).to_be_visible()
        page.go_back()
        expect(row).to_be_visible()
        assert page.locator(".view").evaluate("(view) => view.scrollTop") == 1000


@pytest.mark.parametrize("route", ["#/", "#/traffic"])
def test_escape_stops_all_where_a_page_is_about_all_also_while_text_is_written(tab, rig, route):
    page = tab.open(route)
    run(rig)
    field = page.locator('input[type="search"]')
    field.click()
    page.keyboard.type("a b")
    expect(field).to_have_value("a b")
    assert rig.speed("stage") > 50
    page.keyboard.press("Escape")
    until(lambda: rig.speed("stage") == 0, "Escape did not stop it")
    expect(field).to_have_value("a b")


def test_a_stop_that_a_server_took_along_when_it_ended_is_given_to_the_next(tab, rig):
    page = tab.open("#/axis/stage")
    rig.control.do("power stage off")
    expect(page.locator("#state")).to_contain_text("lost", timeout=10_000)
    page.locator("#stop").click()
    left = page.locator(".notice.error", has_text="it is told again until it can be")
    expect(left).to_be_visible(timeout=10_000)
    asked = []
    page.on("request", lambda request: asked.append(request.url) if request.url.endswith("/stage/stop") else None)
    rig.stop()
    expect(page.locator(".link")).to_have_text("connection lost", timeout=10_000)
    rig.start()
    expect(page.locator(".link")).to_have_text("connected", timeout=10_000)
    until(lambda: asked, "the new server was not told to stop")
    expect(left).to_have_count(0)


def test_escape_closes_what_is_open_first_and_stops_then(tab, rig):
    page = tab.open("#/axis/stage/programs")
    asked = []
    page.on("request", lambda request: asked.append(request.url) if request.url.endswith("/stop") else None)
    run(rig, speed="100")
    text = page.locator("#program-text")
    text.fill("")
    text.press_sequentially("    SET_MAX")
    popup = page.locator("#completions")
    expect(popup).to_be_visible()
    text.press("Escape")
    expect(popup).to_be_hidden()
    assert asked == [] and rig.speed("stage") > 50
    text.press("Escape")
    until(lambda: rig.speed("stage") == 0, "the second Escape did not stop it")


def test_the_page_of_a_drive_follows_when_its_axis_is_described_anew(browser, rig):
    real = RealPanel(rig, unit="")
    tab = Tab(browser, real)
    page = tab.open("#/axis/bench")
    expect(page.locator("#position")).to_have_text("0.00 steps")
    real.stop()
    expect(page.locator(".link")).to_have_text("connection lost", timeout=10_000)
    real = RealPanel(rig, port=real.port)
    expect(page.locator("#position")).to_have_text("0.000 mm", timeout=15_000)
    expect(page.locator("#goal")).to_have_attribute("placeholder", re.compile("mm"))
    tab.close()
    real.stop()


def test_a_stream_that_is_refused_is_told_where_it_is_missing_until_it_is_there(tab, rig):
    address = rig.panel.removeprefix("http://").rstrip("/")
    with contextlib.ExitStack() as others:
        for _ in range(16):
            connection = others.enter_context(contextlib.closing(http.client.HTTPConnection(address)))
            connection.request("GET", "/v1/events?drive=stage")
            assert connection.getresponse().status == 200
        page = tab.open("#/rig")
        expect(page.locator("#missing")).to_contain_text("Some of this page is missing")
        expect(page.locator(".notice.error")).to_have_count(1)
        tab.shoot("refused")
    expect(page.locator("#missing")).to_be_hidden(timeout=20_000)
    expect(page.locator("#rig-time")).not_to_have_text("–")


@pytest.mark.parametrize("route", ["#/axis/100%", "#/nowhere", "#/%"])
def test_an_address_that_cannot_be_read_says_so_and_leads_to_the_drives(tab, route):
    page = tab.open(route)
    expect(page.locator("main")).to_contain_text("There is no page")
    page.get_by_role("link", name="All drives", exact=True).click()
    expect(page.get_by_role("article", name="stage")).to_be_visible()


def test_every_page_has_its_title_and_the_first_link_leads_past_the_header(tab):
    for route, title in [("#/", "Drives"), ("#/rig", "Rig"), ("#/traffic", "Traffic"), ("#/axis/stage", "stage"), ("#/axis/stage/settings", "stage, settings")]:
        page = tab.open(route)
        expect(page).to_have_title(f"{title} – stepdrive")
    page.locator(".skip").focus()
    page.keyboard.press("Enter")
    expect(page.locator("main")).to_be_focused()
    expect(page).to_have_title("stage, settings – stepdrive")


def test_drives_are_found_as_they_were_left_and_opened_anywhere_but_on_their_buttons(tab):
    page = tab.open()
    page.get_by_label("Filter drives").fill("sta")
    expect(page.get_by_role("article")).to_have_count(1)
    card = page.get_by_role("article", name="stage")
    card.locator(".stop").click()
    expect(page.get_by_label("Filter drives")).to_be_visible()
    card.locator(".state").click()
    expect(page.locator("#position")).to_be_visible()
    page.go_back()
    expect(page.get_by_label("Filter drives")).to_have_value("sta")
    expect(page.get_by_role("article")).to_have_count(1)


def test_notices_are_few_cover_no_stop_and_go_when_the_same_is_done(tabs, rig):
    for width in [1280, 390]:
        tab = tabs(viewport={"width": width, "height": 500})
        page = tab.open("#/axis/stage")
        for speed in ["1 parsec", "nonsense"]:
            page.locator("#speed").fill(speed)
            page.locator("#run-forward").click()
            expect(page.locator(".notice.error")).to_contain_text(speed.split()[-1])
            expect(page.locator(".notice.error")).to_have_count(1)
        page.locator("#zero").click()
        page.locator("#clear").click()
        expect(page.locator(".notice")).to_have_count(3)
        expect(page.locator(".notice:visible")).to_have_count(2)
        expect(page.locator("#notices .others")).to_have_text("1 more")
        assert page.evaluate(COVERED) == 0
        tab.shoot(f"notices-{width}")
        page.evaluate("location.hash = '#/'")
        expect(page.get_by_role("article", name="stage")).to_be_visible()
        assert page.evaluate(COVERED) == 0
        tab.shoot(f"notices-drives-{width}")
        page.go_back()
        page.locator("#speed").fill("100")
        page.locator("#run-forward").click()
        expect(page.locator(".notice", has_text="nonsense")).to_have_count(0)
        page.locator("#stop").click()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_stops_are_read_easily(tabs, scheme):
    page = tabs(color_scheme=scheme).open("#/axis/stage")
    for stop in ["#stop", "#stop-all"]:
        assert page.locator(stop).evaluate(CONTRAST) >= 4.5
