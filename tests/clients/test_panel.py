"""The panel from a person's chair: what is clicked, typed and held in a real browser, and what the drives really do."""

import contextlib
import re

import pytest
from playwright.sync_api import Error, expect

from panel import RIG, PanelRig, RealPanel, Tab, browser, rig, tab, tabs, until  # noqa: F401

def home(page):
    """Homes the stage, and waits until its position is trusted."""
    page.locator("#speed").fill("1000 steps/s")
    page.locator("#home").click()
    page.locator("#speed").fill("")
    expect(page.locator(".trust")).to_have_text("position trusted", timeout=15_000)


def test_a_first_visit_shows_every_drive_and_leads_to_each(tab):
    page = tab.open()
    expect(page.get_by_role("link", name="stage")).to_be_visible()
    expect(page.get_by_role("link", name="uhv")).to_be_visible()
    expect(page.locator(".badge.virtual").first).to_be_visible()
    expect(page.locator('.chip[data-key="all"] .count')).to_have_text("2")
    tab.shoot("overview")
    page.get_by_role("link", name="stage").click()
    expect(page.locator("#position")).to_have_text(re.compile(r"steps"))
    expect(page.locator(".m")).to_be_visible()
    tab.shoot("drive")


def test_nothing_is_asked_of_other_hosts_and_no_policy_is_broken(tab):
    asked = []
    tab.page.on("request", lambda request: asked.append(request.url))
    page = tab.open("#/axis/stage")
    expect(page.locator("#position")).to_be_visible()
    for part in ["settings", "programs"]:
        page.goto(f"{tab.rig.panel}#/axis/stage/{part}")
    page.goto(f"{tab.rig.panel}#/rig")
    assert asked and all(url.startswith((tab.rig.panel, "blob:", "data:")) for url in asked), asked
    reply = page.request.get(tab.rig.panel)
    policy = reply.headers["content-security-policy"]
    assert "default-src 'none'" in policy and "unsafe" not in policy


def test_a_jog_runs_while_its_button_is_held_and_brakes_when_it_is_released(tab, rig):
    page = tab.open("#/axis/stage")
    forward = page.locator("#jog-forward")
    forward.hover()
    page.mouse.down()
    until(lambda: rig.speed("stage") > 50, "the jog never began")
    # Longer than the dead man's timer: renewals keep it going.
    page.wait_for_timeout(1200)
    assert rig.speed("stage") > 50
    page.mouse.up()
    until(lambda: rig.speed("stage") == 0, "the stage went on after the release")
    stood = rig.drive("stage")["position"]
    page.wait_for_timeout(700)
    assert rig.drive("stage")["position"] == stood


def test_a_jog_by_an_arrow_key_ends_with_the_key(tab, rig):
    page = tab.open("#/axis/stage")
    expect(page.locator("#jog-back")).to_be_visible()
    page.keyboard.down("ArrowLeft")
    until(lambda: rig.speed("stage") > 50, "the jog never began")
    page.keyboard.up("ArrowLeft")
    until(lambda: rig.speed("stage") == 0, "the stage went on after the key came up")


LEAVING = {
    "it is closed": lambda page: page.close(),
    "it is loaded again": lambda page: page.reload(),
    "another of its pages is opened": lambda page: page.evaluate("location.hash = '#/'"),
    "another window has the keyboard": lambda page: page.evaluate("dispatchEvent(new Event('blur'))"),
    "its process dies": lambda page: kill(page),
}


def kill(page):
    """Ends the page's process: it has no chance to say anything."""
    with contextlib.suppress(Error):
        page.goto("chrome://crash", timeout=1000)


@pytest.mark.parametrize("how", LEAVING)
def test_a_jog_ends_with_its_page_when(tab, rig, how):
    page = tab.open("#/axis/stage")
    page.locator("#jog-forward").hover()
    page.mouse.down()
    until(lambda: rig.speed("stage") > 50, "the jog never began")
    LEAVING[how](page)
    until(lambda: rig.speed("stage") == 0, f"the stage went on though {how}")


def test_a_network_that_goes_away_ends_the_jog(tab, rig):
    page = tab.open("#/axis/stage")
    page.locator("#jog-forward").hover()
    page.mouse.down()
    until(lambda: rig.speed("stage") > 50, "the jog never began")
    tab.context.set_offline(True)
    until(lambda: rig.speed("stage") == 0, "the stage went on without its browser")
    tab.context.set_offline(False)
    page.mouse.up()


def test_a_person_homes_and_moves_with_units_and_sees_the_plan_first(tab, rig):
    page = tab.open("#/axis/stage")
    page.locator("#goal").fill("600 steps")
    page.locator("#move-to").click()
    expect(page.locator("#goal-error")).to_contain_text("has not been homed")
    home(page)
    page.locator("#goal").fill("600")
    expect(page.locator("#preview")).to_contain_text("→ 600.00")
    page.locator("#move-to").click()
    expect(page.locator("#position")).to_have_text("600.00 steps", timeout=10_000)
    page.locator("#goal").fill("-100")
    page.locator("#move-by").click()
    expect(page.locator("#position")).to_have_text("500.00 steps", timeout=10_000)
    assert rig.drive("stage")["position"] == 500 * 16
    tab.shoot("moved")


@pytest.mark.parametrize("how", ["button", "space bar", "escape in a field", "stop all"])
def test_every_stop_stops(tab, rig, how):
    page = tab.open("#/axis/stage")
    page.locator("#speed").fill("200")
    page.locator("#run-forward").click()
    until(lambda: rig.speed("stage") > 100, "the stage never ran")
    if how == "button":
        page.locator("#stop").click()
    elif how == "space bar":
        page.locator("#run-forward").focus()
        page.keyboard.press("Space")
    elif how == "escape in a field":
        page.locator("#goal").focus()
        page.keyboard.press("Escape")
    else:
        page.locator("#stop-all").click()
    until(lambda: rig.speed("stage") == 0, f"it was not stopped by the {how}")


def test_a_space_that_is_typed_is_a_space_and_stops_nothing(tab, rig):
    page = tab.open("#/axis/stage")
    page.locator("#speed").fill("200")
    page.locator("#run-forward").click()
    until(lambda: rig.speed("stage") > 100, "the stage never ran")
    page.locator("#goal").click()
    page.keyboard.type("30 steps")
    expect(page.locator("#goal")).to_have_value("30 steps")
    assert rig.speed("stage") > 100
    page.locator("#stop").click()


def test_a_program_goes_from_text_to_running_with_its_line_shown(tab, rig):
    page = tab.open("#/axis/stage/programs")
    text = page.locator("#program-text")
    text.fill("    SET_MAX_SPEED 80000\n    END\n")
    expect(page.locator("#verdict")).to_have_text("1 error")
    expect(page.locator(".problems")).to_contain_text("out of the range")
    expect(page.locator("#store")).to_be_disabled()
    tab.shoot("program-wrong")
    text.fill("    SET_MAX_SPEED 800\n    RESET_POS\n    MOVE_F 1600\n    SET_WAIT 3s\n    MOVE_R 1600\n    END\n")
    expect(page.locator("#verdict")).to_contain_text("Good")
    page.locator("#simulate-for").fill("10s")
    page.locator("#simulate").click()
    expect(page.locator("#simulated")).to_contain_text("ended at mem0:5")
    assert rig.drive("stage")["position"] == 0, "a simulation moves nothing"
    page.locator("#store").click()
    expect(page.locator(".notice.good")).to_contain_text("6 instructions in memory 0")
    page.locator("#start").click()
    expect(page.locator(".picture .running")).to_contain_text("SET_WAIT", timeout=5_000)
    tab.shoot("program-running")
    until(lambda: rig.drive("stage")["position"] == 1600, "the program did not move the stage")
    page.locator("#stop-program").click()
    expect(page.locator("#program-state")).to_contain_text("stands")
    text.fill("; nothing")
    page.locator("#fetch").click()
    page.locator("#put-in").click()
    expect(text).to_have_value(re.compile("MOVE_F 1600"))


def test_completion_offers_instructions_and_puts_in_the_one_that_is_chosen(tab):
    page = tab.open("#/axis/stage/programs")
    text = page.locator("#program-text")
    text.fill("")
    text.press_sequentially("    SET_MAX")
    expect(page.locator("#completions")).to_contain_text("SET_MAX_SPEED")
    text.press("Enter")
    expect(text).to_have_value("    SET_MAX_SPEED")


def test_a_fault_is_seen_and_cleared(tab, rig):
    page = tab.open("#/axis/uhv/bake")
    expect(page.locator("#temperature")).to_contain_text("°C")
    page.goto(f"{rig.panel}#/rig")
    page.locator("#rig-drive").select_option("uhv")
    fault = page.locator('[data-fault="thermocouple"]')
    fault.get_by_role("button", name="open").click()
    expect(fault.locator(".now")).to_have_text("open")
    page.goto(f"{rig.panel}#/axis/uhv/bake")
    expect(page.locator("#state")).to_contain_text("TOPEN", ignore_case=True)
    expect(page.locator(".latched")).to_contain_text("TOPEN")
    tab.shoot("fault")
    rig.control.do("fault uhv.thermocouple off")
    page.get_by_role("button", name="Clear faults").click()
    expect(page.locator("#state")).to_have_text("holds")
    expect(page.locator(".latched li")).to_have_count(0)


def test_the_motor_is_baked_towards_its_set_point(tab, rig):
    page = tab.open("#/axis/uhv/bake")
    page.locator("#setpoint").fill("60")
    page.locator("#bake-start").click()
    expect(page.locator("#bake-state")).to_contain_text("baking, set-point 60")
    rig.control.clock("x100")
    expect(page.locator("#temperature")).to_have_text(re.compile(r"(59|60)\.\d °C"), timeout=20_000)
    tab.shoot("bake")
    page.locator("#bake-end").click()
    expect(page.locator("#bake-state")).to_have_text("not baking")


def test_time_is_paused_stepped_and_let_go(tab, rig):
    page = tab.open("#/rig")
    page.locator("#pause").click()
    expect(page.locator("#clock")).to_have_text("Time stands.")
    before = rig.control.now()
    page.locator("#step").fill("5s")
    page.locator("#do-step").click()
    until(lambda: rig.control.now() == before + 5_000_000_000, "time was not stepped by 5 s")
    page.get_by_role("button", name="x10", exact=True).click()
    expect(page.locator("#clock")).to_contain_text("Time passes: x10")
    tab.shoot("rig")


def test_an_input_is_forced_by_a_click_and_released(tab, rig):
    page = tab.open("#/rig")
    page.locator('[data-input="IN0"]').click()
    until(lambda: rig.drive("stage")["inputs"]["IN0"]["level"], "IN0 was not forced")
    expect(page.locator('[data-input="IN0"]')).to_have_attribute("aria-pressed", "true")
    page.get_by_role("button", name="release").click()
    until(lambda: rig.drive("stage")["inputs"]["IN0"]["forced"] is None, "IN0 was not released")


def test_the_front_panel_is_set_and_counts_from_the_next_power_up(tab, rig):
    page = tab.open("#/rig")
    page.get_by_label("Front panel", exact=True).select_option("bF")
    page.get_by_label("Program of the front panel").select_option("2")
    page.locator("#front-panel").click()
    until(lambda: rig.drive("stage")["quantities"]["MODE_N_PROGRAMS"] == 2, "the front panel was not set")
    page.locator("#power").click()
    expect(page.locator("#power")).to_have_text("Supply off")
    page.locator("#power").click()
    until(lambda: rig.drive("stage")["quantities"]["N_PROGRAM"] == 2, "the program of bF did not start")


def test_a_setting_with_a_mistake_is_not_sent_and_a_good_one_is_read_back(tab, rig):
    page = tab.open("#/axis/stage/settings")
    field = page.get_by_label("MAX_SPEED", exact=True)
    field.fill("99999")
    expect(page.get_by_text("16 to 15600").first).to_be_visible()
    expect(field).to_have_attribute("aria-invalid", "true")
    expect(page.locator("#apply")).to_be_disabled()
    tab.shoot("settings-mistake")
    field.fill("1234")
    page.locator("#apply").click()
    expect(page.locator("#report")).to_contain_text("MAX_SPEED")
    expect(page.locator("#report")).to_contain_text("reads 1234")
    assert rig.drive("stage")["quantities"]["MAX_SPEED"] == 1234


def test_two_browsers_see_the_same_and_only_one_jogs(tabs, rig):
    first, second = tabs(), tabs()
    mine, theirs = first.open("#/axis/stage"), second.open("#/axis/stage")
    mine.locator("#jog-forward").hover()
    mine.mouse.down()
    until(lambda: rig.speed("stage") > 50, "the jog never began")
    expect(theirs.locator("#state")).to_have_text("jogging")
    theirs.keyboard.down("ArrowLeft")
    expect(theirs.locator(".notice.error")).to_be_visible()
    theirs.keyboard.up("ArrowLeft")
    assert rig.speed("stage") > 50
    theirs.locator("#stop").click()
    until(lambda: rig.speed("stage") == 0, "another person's stop must count")
    # The first still holds its button; that must not start the motor anew.
    mine.wait_for_timeout(700)
    assert rig.speed("stage") == 0
    mine.mouse.up()
    where = mine.locator("#position").text_content()
    expect(theirs.locator("#position")).to_have_text(where)


def test_the_page_finds_its_server_again_after_a_restart(tab, rig):
    page = tab.open("#/axis/stage")
    rig.stop()
    expect(page.locator(".link")).to_have_text("connection lost")
    expect(page.locator("#state")).to_contain_text("not known")
    tab.shoot("connection-lost")
    rig.start()
    expect(page.locator(".link")).to_have_text("connected", timeout=10_000)
    # What is shown is what is, not what was: the drive is moved by somebody else.
    before = page.locator(".m-carriage").get_attribute("transform")
    rig.post("/v1/axes/stage/move", {"by": 150})
    expect(page.locator("#position")).to_have_text("150.00 steps", timeout=10_000)
    expect(page.locator(".m-carriage")).not_to_have_attribute("transform", before)


def test_a_drive_that_is_lost_is_shown_as_lost_with_the_age_of_its_reading(tab, rig):
    page = tab.open("#/axis/stage")
    expect(page.locator("#state")).to_have_text("de-energised")
    rig.control.do("power stage off")
    expect(page.locator("#state")).to_contain_text("lost", timeout=2_000)
    expect(page.locator("#age")).to_contain_text("last seen")
    tab.shoot("lost")
    rig.control.do("power stage on")
    expect(page.locator("#state")).to_have_text("de-energised", timeout=5_000)


def test_traffic_is_decoded_filtered_and_paused(tab, rig):
    page = tab.open("#/traffic")
    page.locator("#own").check()
    rows = page.locator(".traffic tbody tr")
    expect(rows.first).to_be_visible()
    expect(page.locator(".traffic")).to_contain_text("ABS_POS")
    tab.shoot("traffic")
    page.locator("#traffic-pause").click()
    expect(page.locator("#traffic-state")).to_contain_text("paused")
    page.get_by_label("Filter the traffic").fill("no such word")
    expect(rows).to_have_count(0)


def test_a_telephone_shows_the_drives_and_stops_them(tabs, rig):
    tab = tabs(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    page = tab.open("#/axis/stage")
    width = page.evaluate("document.documentElement.scrollWidth")
    assert width <= 390, f"the page is {width} wide, and has to be moved sideways"
    page.locator("#speed").fill("200")
    page.locator("#run-forward").tap()
    until(lambda: rig.speed("stage") > 100, "the stage never ran")
    page.evaluate("scrollTo(0, document.body.scrollHeight)")
    expect(page.locator("#stop")).to_be_in_viewport()
    page.locator("#stop").tap()
    until(lambda: rig.speed("stage") == 0, "it was not stopped")
    page.evaluate("scrollTo(0, 0)")
    tab.shoot("telephone")
    page.goto(f"{rig.panel}#/")
    expect(page.get_by_role("link", name="stage")).to_be_visible()
    tab.shoot("telephone-overview")


def test_dark_mode_follows_the_system_and_can_be_chosen(tabs):
    tab = tabs(color_scheme="dark")
    page = tab.open("#/axis/stage")
    background = "getComputedStyle(document.documentElement).backgroundColor"
    assert page.evaluate(background) == "rgb(18, 21, 27)"
    tab.shoot("dark")
    page.locator("#theme").click()
    assert page.evaluate(background) == "rgb(244, 245, 247)"


def test_everything_is_reached_by_keyboard_alone(tab, rig):
    page = tab.open()
    for _ in range(20):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.textContent") == "stage":
            break
    page.keyboard.press("Enter")
    expect(page.locator("#position")).to_be_visible()
    for _ in range(40):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.id") == "goal":
            break
    assert page.evaluate("document.activeElement.id") == "goal"
    page.keyboard.type("100")
    for _ in range(4):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.id") == "move-by":
            break
    page.keyboard.press("Enter")
    until(lambda: rig.drive("stage")["position"] == 1600, "the move by keyboard did not come about")
    # The space bar is the stop; boxes are ticked by Enter.
    page.locator("#override").focus()
    page.keyboard.press("Enter")
    expect(page.locator("#override")).to_be_checked()
    assert rig.drive("stage")["position"] == 1600
    page.get_by_role("tab", name="Drive").focus()
    page.keyboard.press("ArrowRight")
    expect(page.get_by_role("tab", name="Settings")).to_be_focused()


def test_whatever_a_name_or_an_error_says_it_is_text(tab):
    page = tab.open("#/axis/%3Cimg%20src%3Dx%20onerror%3Dalert(1)%3E")
    expect(page.locator("main")).to_contain_text("There is no drive <img src=x")
    assert page.locator("main img").count() == 0


def test_a_token_is_asked_for_once_and_a_wrong_one_is_refused(browser, tmp_path):
    text = RIG.replace('api = "{host}:{api}"', 'api = "{host}:{api}"\napi_token = "sixteen-letters!"')
    rig = PanelRig(tmp_path, text)
    try:
        rig.start()
        tab = Tab(browser, rig)
        page = tab.page
        page.goto(rig.panel)
        expect(page.get_by_text("This is not the token.")).to_have_count(0)
        page.locator("#token").fill("not the token at all")
        page.get_by_role("button", name="Go on").click()
        expect(page.get_by_text("This is not the token.")).to_be_visible()
        page.locator("#token").fill("sixteen-letters!")
        page.get_by_role("button", name="Go on").click()
        expect(page.get_by_role("link", name="stage")).to_be_visible()
        expect(page.get_by_role("link", name="Traffic")).to_be_visible()
        page.get_by_role("link", name="Rig").click()
        expect(page.locator("#rig-time")).not_to_have_text("–")
        page.reload()
        expect(page.get_by_role("link", name="stage")).to_be_visible()
        expect(page.locator("#token")).to_have_count(0)
        tab.close()
        rig.stop()
    finally:
        rig.clean_up()


def test_a_real_drive_looks_different_and_is_moved_the_same_way(browser, rig):
    real = RealPanel(rig)
    tab = Tab(browser, real)
    page = tab.open("#/axis/bench")
    expect(page.locator(".axis-head .badge.real")).to_have_text("real: moves metal")
    expect(page.locator("body")).to_have_class(re.compile("real"))
    expect(page.get_by_role("link", name="Rig")).to_have_count(0)
    home(page)
    page.locator("#goal").fill("10mm")
    page.locator("#move-to").click()
    expect(page.locator("#position")).to_have_text("10.000 mm", timeout=10_000)
    tab.shoot("real")
    page.locator("#goal").fill("50mm")
    page.locator("#move-to").click()
    expect(page.locator("#goal-error")).to_contain_text("soft limits [-5, 40] mm")
    tab.close()
    real.stop()
    assert rig.drive("stage")["position"] == 400 * 16
