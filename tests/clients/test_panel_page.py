"""The panel's page itself: what it draws, tells, keeps and gives, and that everybody can use it."""

import contextlib
import http.client
import re

from playwright.sync_api import expect

from panel import PanelRig, RealPanel, Tab, browser, rig, tab, tabs, until  # noqa: F401

ROUTES = ["#/", "#/axis/stage", "#/axis/stage/settings", "#/axis/stage/programs", "#/axis/uhv/bake", "#/rig", "#/traffic"]

# What a control is called, as far as the page says; empty where it says nothing.
NAMELESS = """() => [...document.querySelectorAll("button, input, select, textarea, a, [role=img], [role=table], [role=tabpanel]")]
    .filter((element) => element.checkVisibility())
    .filter((element) => ![element.getAttribute("aria-label"), element.labels?.[0]?.textContent, element.textContent]
        .some((name) => name?.trim()))
    .map((element) => element.outerHTML)"""


def test_a_flag_tells_what_it_means_and_where_that_stands(tab):
    page = tab.open("#/axis/stage")
    flag, tip = page.get_by_role("button", name="HiZ, on"), page.get_by_role("tooltip")
    expect(tip).to_have_count(0)
    flag.hover()
    expect(tip).to_contain_text("HiZ")
    expect(tip).to_contain_text("ch. 4.3")
    page.mouse.move(0, 0)
    expect(tip).to_have_count(0)
    flag.focus()
    expect(tip).to_contain_text("HiZ")
    page.keyboard.press("Tab")
    expect(tip).to_contain_text("STOP")
    tab.shoot("flag")


def test_the_plot_is_paused_and_given_as_a_file(tab, rig):
    page = tab.open("#/axis/stage")
    page.locator("#goal").fill("50")
    page.locator("#move-by").click()
    expect(page.locator("#position")).to_have_text("50.00 steps")
    page.locator("#plot-pause").click()
    expect(page.locator("#plot-pause")).to_have_attribute("aria-pressed", "true")
    with page.expect_download() as download:
        page.locator("#plot-csv").click()
    head, *rows = download.value.path().read_text().splitlines()
    assert head == "time,unix_s,position_steps,speed_steps_per_s"
    positions = [float(row.split(",")[2]) for row in rows]
    times = [float(row.split(",")[1]) for row in rows]
    assert positions[-1] == 50 and min(positions) == 0 and len(positions) > 10
    assert times == sorted(times)


def test_zooming_into_the_plot_holds_it_still(tab):
    page = tab.open("#/axis/stage")
    box = page.locator(".u-over").bounding_box()
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + box["width"] * 0.5, middle)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] * 0.9, middle, steps=5)
    page.mouse.up()
    expect(page.locator("#plot-pause")).to_have_attribute("aria-pressed", "true")
    page.locator("#plot-pause").click()
    expect(page.locator("#plot-pause")).to_have_text("Pause")


def test_the_mechanism_shows_the_carriage_where_it_is_and_a_rotor_that_is_held(tab, rig):
    page = tab.open("#/axis/stage")
    carriage = page.locator(".m-carriage")
    expect(page.locator(".m")).to_contain_text("SET_ZERO")
    expect(page.locator(".m")).to_contain_text("IN1")

    def place() -> float:
        return float(re.search(r"translate\(([-\d.]+)", carriage.get_attribute("transform"))[1])

    stands = place()
    page.locator("#goal").fill("400")
    page.locator("#move-by").click()
    expect(page.locator(".m-target")).to_be_visible()
    expect(page.locator("#position")).to_have_text("400.00 steps", timeout=10_000)
    travel = page.locator(".m-rail").evaluate("(rail) => rail.x2.baseVal.value - rail.x1.baseVal.value")
    # To scale: 400 of 2000 full steps of travel.
    until(lambda: abs(place() - stands - travel / 5) < 1, "the carriage is not drawn where it is")
    expect(page.locator(".m-target")).to_be_hidden()
    rig.control.do("fault stage.rotor blocked")
    page.locator("#run-forward").click()
    expect(page.locator(".m-stall")).to_be_visible()
    tab.shoot("stalled")
    page.locator("#stop").click()


def test_what_differs_from_the_flash_of_an_smd3_is_shown_once_it_is_known(tab, rig):
    page = tab.open("#/axis/uhv/settings")
    row = page.locator("tr", has=page.get_by_label("VMAX", exact=True))
    expect(row.locator(".stored")).to_have_text("?")
    page.get_by_role("button", name="Store", exact=True).click()
    expect(row.locator(".stored")).to_have_text("1000")
    page.get_by_label("VMAX", exact=True).fill("500")
    page.locator("#apply").click()
    expect(page.locator("#report")).to_contain_text("reads 500")
    expect(row).to_have_class(re.compile("unstored"))
    expect(row).to_have_class(re.compile("differs"))
    tab.shoot("settings-stored")
    page.get_by_role("button", name="Load", exact=True).click()
    expect(page.get_by_label("VMAX", exact=True)).to_have_value("1000")
    expect(row).not_to_have_class(re.compile("unstored"))


def test_an_address_is_checked_as_it_is_typed(tab, rig):
    page = tab.open("#/axis/stage/settings")
    for name in ["IP", "Subnet Mask", "Gateway IP"]:
        field = page.get_by_label(name, exact=True)
        good = field.input_value()
        for bad in ["hello", "300.1.1.1", "192.168.1", "192.168.01.1", ""]:
            field.fill(bad)
            expect(field).to_have_attribute("aria-invalid", "true")
            expect(page.locator("#apply")).to_be_disabled()
        field.fill(good)
        expect(field).to_have_attribute("aria-invalid", "false")
    page.get_by_label("IP", exact=True).fill("10.0.0.255")
    page.locator("#apply").click()
    expect(page.locator("#report")).to_contain_text("reads 10.0.0.255")


def test_a_value_that_the_controller_refuses_is_said_at_its_field(tab, rig):
    page = tab.open("#/axis/uhv/settings")
    page.get_by_label("VSTART", exact=True).fill("60")
    page.get_by_label("VSTOP", exact=True).fill("50")
    page.locator("#apply").click()
    expect(page.locator("#set-VSTART-error")).to_contain_text("may not be above VSTOP")
    expect(page.locator('.settings [aria-invalid="true"]')).to_have_count(1)


def put(rig, path: str, body: dict):
    """Changes something as another browser would."""
    rig.control._ask("PUT", path, body)


def test_settings_that_are_changed_elsewhere_are_read_again_and_edits_are_kept(tab, rig):
    page = tab.open("#/axis/stage/settings")
    acceleration, speed = page.get_by_label("ACC", exact=True), page.get_by_label("MAX_SPEED", exact=True)
    acceleration.fill("1500")
    put(rig, "/v1/axes/stage/settings", {"set": {"ACC": 2222, "MAX_SPEED": 1234}})
    expect(speed).to_have_value("1234", timeout=10_000)
    expect(acceleration).to_have_value("1500")
    expect(page.locator("#set-ACC-elsewhere")).to_have_text("changed elsewhere to 2222")
    expect(acceleration).to_be_focused()
    tab.shoot("settings-elsewhere")
    page.locator("#discard").click()
    expect(acceleration).to_have_value("2222")
    expect(page.locator("#set-ACC-elsewhere")).to_have_text("")
    # What nobody tells is read by the button.
    page.route("**/settings", lambda route: route.fulfill(status=502, json={"error": "it was lost"}))
    page.locator("#read-again").click()
    expect(page.locator("#settings-read")).to_contain_text("it was lost")
    expect(acceleration).to_have_value("2222")
    page.unroute("**/settings")
    page.locator("#read-again").click()
    expect(page.locator("#settings-read")).to_have_text("")


def test_what_cannot_be_set_while_the_motor_is_energised_can_be_set_again_afterwards(tab, rig):
    page = tab.open("#/axis/stage/settings")
    field = page.get_by_label("CURRENT_OR_VOLTAGE", exact=True)
    expect(field).to_be_enabled()
    page.locator("#stop").click()
    rig.post("/v1/axes/stage/run", {"direction": "+", "speed": 100})
    expect(field).to_be_disabled(timeout=10_000)
    rig.post("/v1/axes/stage/stop", {"how": "free"})
    expect(field).to_be_enabled(timeout=10_000)


def test_edits_of_settings_survive_another_tab_of_the_page(tab, rig):
    page = tab.open("#/axis/stage/settings")
    page.get_by_label("ACC", exact=True).fill("1500")
    for part in ["Programs", "Drive", "Settings"]:
        page.get_by_role("tab", name=part).click()
    expect(page.get_by_label("ACC", exact=True)).to_have_value("1500")
    expect(page.locator("#apply")).to_have_text("Apply and verify 1")
    page.goto(f"{rig.panel}#/axis/uhv/settings")
    expect(page.get_by_label("VMAX", exact=True)).to_be_visible()
    expect(page.locator("#apply")).to_be_disabled()
    page.goto(f"{rig.panel}#/axis/stage/settings")
    page.locator("#apply").click()
    expect(page.locator("#report")).to_contain_text("reads 1500")


LOOP = "    SET_MAX_SPEED 400\n    LOOP_PROGRAM 50 {\n        MOVE_F 160\n        SET_WAIT 1s\n        MOVE_R 160\n    }\n    END\n"


def store_and_start(rig, text: str):
    put(rig, "/v1/axes/stage/programs", {"text": text})
    rig.post("/v1/axes/stage/programs/0/start", {})


def test_what_a_person_wrote_is_replaced_only_if_they_say_so_and_can_be_undone(tab, rig, tmp_path):
    put(rig, "/v1/axes/stage/programs", {"text": LOOP})
    page = tab.open("#/axis/stage/programs")
    text, fetch = page.locator("#program-text"), page.locator("#fetch")
    # What nobody wrote is replaced at once.
    fetch.click()
    expect(text).to_have_value(re.compile("LOOP_PROGRAM 50"))
    expect(page.locator("#put-in")).to_be_hidden()
    mine = "; mine, and worth keeping\n    MOVE_F 16\n    END\n"
    text.fill(mine)
    fetch.click()
    expect(page.locator("#keep-mine")).to_be_focused()
    tab.shoot("program-asks")
    page.locator("#keep-mine").click()
    expect(text).to_have_value(mine)
    fetch.click()
    page.locator("#put-in").click()
    expect(text).to_have_value(re.compile("LOOP_PROGRAM 50"))
    text.press("Control+z")
    expect(text).to_have_value(mine)
    (tmp_path / "other.smsd").write_text("    MOVE_R 16\n    END\n")
    page.locator('input[type="file"]').set_input_files(tmp_path / "other.smsd")
    page.locator("#put-in").click()
    expect(text).to_have_value("    MOVE_R 16\n    END\n")
    text.press("Control+z")
    expect(text).to_have_value(mine)
    # It stays while another part of the page is looked at, and so does that it is not stored.
    text.fill("move_f 16\nend")
    page.get_by_role("tab", name="Drive").click()
    page.get_by_role("tab", name="Programs").click()
    expect(text).to_have_value("move_f 16\nend")
    page.locator("#format").click()
    expect(text).to_have_value("    MOVE_F 16\n    END\n")
    text.press("Control+z")
    expect(text).to_have_value("move_f 16\nend")
    fetch.click()
    expect(page.locator("#put-in")).to_be_visible()


def test_a_drive_without_programs_leaves_the_text_as_it_is(tab, rig):
    page = tab.open("#/axis/stage/programs")
    before = page.locator("#program-text").input_value()
    page.locator("#fetch").click()
    expect(page.locator(".notice")).to_contain_text("There are no programs in stage")
    assert page.locator("#program-text").input_value() == before


def test_the_line_that_runs_is_marked_for_everybody(tabs, rig):
    tab, other = tabs(), tabs()
    page = tab.open("#/axis/stage/programs")
    running = page.locator(".picture .running")
    page.locator("#program-text").fill(LOOP)
    page.locator("#store").click()
    expect(page.locator(".notice.good")).to_contain_text("Stored")
    page.locator("#start").click()
    expect(running).to_contain_text("SET_WAIT", timeout=10_000)
    expect(page.locator("#program-line")).to_have_text("at line 4.")
    page.get_by_role("tab", name="Drive").click()
    page.get_by_role("tab", name="Programs").click()
    expect(running).to_contain_text("SET_WAIT", timeout=10_000)
    page.reload()
    expect(running).to_contain_text("SET_WAIT", timeout=10_000)
    # Another browser has another text.
    theirs = other.open("#/axis/stage/programs")
    expect(theirs.locator("#other-runs")).to_be_visible(timeout=10_000)
    expect(theirs.locator(".picture .running")).to_have_count(0)
    other.shoot("program-other-runs")
    theirs.locator("#show-running").click()
    expect(theirs.locator(".picture .running")).to_contain_text("SET_WAIT", timeout=10_000)
    expect(theirs.locator("#other-runs")).to_be_hidden()
    # A comment changes no program; an instruction does.
    page.locator("#program-text").fill("; to and fro\n" + LOOP)
    expect(page.locator("#program-line")).to_have_text("at line 5.", timeout=10_000)
    page.locator("#program-text").fill(LOOP.replace("MOVE_F 160", "MOVE_F 161"))
    expect(page.locator("#other-runs")).to_be_visible()
    expect(running).to_have_count(0)
    page.locator("#stop").click()
    expect(page.locator("#other-runs")).to_be_hidden(timeout=10_000)


def test_wrong_words_in_the_inputs_of_a_simulation_are_refused(tab, rig):
    page = tab.open("#/axis/stage/programs")
    page.locator("#program-text").fill("    WAIT_IN1\n    END\n")
    expect(page.locator("#verdict")).to_contain_text("Good")
    inputs, error = page.locator("#simulate-inputs"), page.locator("#simulate-error")
    for text, told in [("IN0 IN1=at:1s", "“IN0” does not say"), ("IN1=at:1s in1=at:2s", "IN1 is given twice"),
                       ("=on", "“=on” does not say"), ("IN9=on", "there is no input IN9"), ("IN1=soon", "at:TIME")]:
        inputs.fill(text)
        page.locator("#simulate").click()
        expect(error).to_contain_text(told)
    inputs.fill("IN1=at:1s..2s,at:3s")
    page.locator("#simulate").click()
    expect(page.locator("#simulated")).to_have_text("ended at mem0:1, line 2")
    expect(error).to_have_text("")


def test_a_simulation_speaks_of_lines_as_the_editor_does_and_in_the_unit_of_the_axis(browser, rig):
    real = RealPanel(rig)
    tab = Tab(browser, real)
    page = tab.open("#/axis/bench/programs")
    page.locator("#program-text").fill("; out\n    SET_MAX_SPEED 400\n    MOVE_R 1600\n    SET_WAIT 1s\n    END\n")
    expect(page.locator("#verdict")).to_contain_text("Good")
    page.locator("#simulate").click()
    expect(page.locator("#simulated")).to_have_text("ended at mem0:3, line 5")
    heads = page.locator(".timeline th")
    expect(heads.filter(has_text="Position, mm")).to_have_count(1)
    expect(heads.filter(has_text="Speed, mm/s")).to_have_count(1)
    last = page.locator(".timeline tbody tr").last
    expect(last.locator("td").nth(1)).to_have_text("5")
    # 100 full steps of a screw of 5 mm, 200 steps a turn.
    expect(last.locator("td").nth(3)).to_have_text("-2.500")
    tab.shoot("simulation")
    tab.close()
    real.stop()


def test_limits_are_enabled_by_a_switch_and_then_homed_to(tab, rig):
    page = tab.open("#/axis/uhv/bake")
    limits, home = page.get_by_role("switch", name="The limit inputs stop the motor"), page.locator("#home-negative")
    expect(limits).to_have_attribute("aria-checked", "false")
    expect(home).to_be_disabled()
    expect(page.locator("#no-homing")).to_have_text("Homing needs a limit that stops the motor.")
    expect(page.locator(".limit").first).to_contain_text("active high (LP-), stops nothing now")
    limits.click()
    expect(limits).to_have_attribute("aria-checked", "true")
    expect(home).to_be_enabled()
    expect(page.locator(".limit").first).to_contain_text("stops the motor")
    page.get_by_role("switch", name="enabled L-").click()
    expect(home).to_be_disabled()
    expect(page.locator("#home-positive")).to_be_enabled()
    # Another browser turns it on again, and has the input the other way round.
    put(rig, "/v1/axes/uhv/settings", {"set": {"L-": 1, "LP-": 1}})
    expect(home).to_be_enabled(timeout=10_000)
    expect(page.locator(".limit").first).to_contain_text("active low (LP-)")
    tab.shoot("limits")


def test_a_broken_sensor_has_no_temperature(tab, rig):
    page = tab.open("#/axis/uhv/bake")
    expect(page.locator("#temperature")).to_have_text(re.compile(r"\d °C"))
    rig.control.do("fault uhv.thermocouple open")
    expect(page.locator("#temperature")).to_have_text("–")
    expect(page.locator("#sensor")).to_contain_text("sensor is open (TOPEN)")
    rig.control.do("fault uhv.thermocouple off")
    page.get_by_role("button", name="Clear faults").click()
    expect(page.locator("#temperature")).to_have_text(re.compile(r"\d °C"))
    expect(page.locator("#sensor")).to_have_text("")


def test_traffic_that_comes_during_a_pause_waits_and_is_counted(tab, rig):
    page = tab.open("#/traffic")
    state, rows = page.locator("#traffic-state"), page.locator(".traffic tbody tr")
    page.locator("#own").check()
    expect(rows.nth(20)).to_be_visible(timeout=10_000)
    # What is there stays as it is when more comes: nothing is built anew.
    rows.first.evaluate("(row) => { row.dataset.seen = 'yes'; }")
    expect(rows.nth(60)).to_be_visible(timeout=10_000)
    expect(rows.first).to_have_attribute("data-seen", "yes")
    pause = page.locator("#traffic-pause")
    pause.click()
    seen = rows.count()
    kept = int(re.match(r"\d+ of (\d+)", state.text_content())[1])
    expect(state).to_have_text(re.compile(r"paused: [1-9]\d+ wait$"), timeout=10_000)
    assert rows.count() == seen, "nothing moves while it is paused"
    waits = int(re.search(r"paused: (\d+) wait", state.text_content())[1])
    pause.click()
    expect(pause).to_have_text("Pause")
    assert int(re.match(r"\d+ of (\d+)", state.text_content())[1]) >= kept + waits, "what waited is there"
    expect(state).to_contain_text("the last 400 shown", timeout=60_000)
    expect(rows).to_have_count(400)
    box = page.locator(".traffic")
    until(lambda: box.evaluate("(box) => box.scrollTop + box.clientHeight > box.scrollHeight - 60"), "it does not follow")


def test_faults_are_set_by_labelled_fields_and_the_supply_by_a_switch(tab, rig):
    page = tab.open("#/rig")
    late = page.locator('[data-fault="reply-delay"]')
    late.get_by_label("late by").fill("15")
    late.get_by_label("±").fill("2")
    late.get_by_role("button", name="Set").click()
    expect(late.locator(".now")).to_have_text("15ms 2ms")
    late.get_by_role("button", name="off").click()
    expect(late.locator(".now")).to_have_text("off")
    refusal = page.locator('[data-fault="exception"]')
    refusal.get_by_label("code").select_option("06")
    refusal.get_by_role("button", name="Set").click()
    expect(refusal.locator(".now")).to_have_text("06 30%")
    refusal.get_by_role("button", name="off").click()
    supply = page.get_by_role("switch", name="Supply")
    expect(supply).to_have_attribute("aria-checked", "true")
    supply.click()
    expect(supply).to_have_attribute("aria-checked", "false")
    until(lambda: not rig.drive("stage")["powered"], "the supply was not taken away")
    tab.shoot("rig-faults")
    supply.click()
    expect(supply).to_have_attribute("aria-checked", "true")


def test_a_rig_that_is_not_heard_has_no_time_that_goes_on(tab, rig):
    page = tab.open("#/rig")
    expect(page.locator("#clock")).to_have_text("Time passes: real")
    rig.stop()
    expect(page.locator("#clock")).to_contain_text("is not known", timeout=30_000)
    expect(page.locator("#rig-missing")).to_contain_text("not heard")
    stood = page.locator("#rig-time").text_content()
    page.wait_for_timeout(300)
    assert page.locator("#rig-time").text_content() == stood
    rig.start()
    expect(page.locator("#clock")).to_have_text("Time passes: real", timeout=30_000)
    expect(page.locator("#rig-missing")).to_have_text("")
    tab.complaints.clear()


def test_a_stream_that_is_refused_is_told_where_it_is_missing(tab, rig):
    host = rig.panel.removeprefix("http://").split("/")[0]
    with contextlib.ExitStack() as watchers:
        for path, most in [("/v1/events", 40), ("/v1/traffic", 40)]:
            for _ in range(most):
                watcher = watchers.enter_context(contextlib.closing(http.client.HTTPConnection(host, timeout=10)))
                watcher.request("GET", path, headers={"Accept": "text/event-stream"})
                if watcher.getresponse().status == 503:
                    break
        page = tab.open("#/rig")
        expect(page.locator("#rig-missing")).to_contain_text("cannot be followed")
        expect(page.locator("#clock")).to_contain_text("is not known")
        page.goto(f"{rig.panel}#/traffic")
        expect(page.locator("#traffic-missing")).to_contain_text("cannot be followed")
        tab.shoot("refused")
    expect(page.locator("#traffic-missing")).to_have_text("", timeout=30_000)


def test_hundreds_of_drives_are_found_among_each_other(browser, tmp_path):
    drive = '[[drive]]\nname = "d{}"\nmodel = "SMSD-4.2LAN"\nmodbus_tcp = "{{host}}:0"\n'
    text = '[rig]\napi = "{host}:{api}"\n' + "".join(drive.format(number) for number in range(300))
    rig = PanelRig(tmp_path, text)
    try:
        rig.start()
        tab = Tab(browser, rig)
        page = tab.open()
        expect(page.locator('.chip[data-key="rest"] .count')).to_have_text("300", timeout=10_000)
        assert page.locator(".drive-row").count() < 40, "only what is seen is in the page"
        page.locator(".view").evaluate("(view) => view.scrollTo(0, view.scrollHeight)")
        expect(page.get_by_role("link", name="d299", exact=True)).to_be_visible()
        tab.shoot("overview-many")
        page.get_by_label("Filter drives").fill("d12")
        expect(page.locator(".drive-row")).to_have_count(11)
        tab.close()
        rig.stop()
    finally:
        rig.clean_up()


def test_every_control_has_a_name(tabs, rig):
    tab = tabs(color_scheme="dark")
    for route in ROUTES:
        page = tab.open(route)
        expect(page.locator("main h1, main h2").first).to_be_visible()
        page.wait_for_timeout(300)
        assert page.evaluate(NAMELESS) == [], route
        tab.shoot(f"dark{re.sub('[#/]+', '-', route)}")


def test_no_page_is_wider_than_a_telephone(tabs, rig):
    tab = tabs(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    for route in ROUTES:
        page = tab.open(route)
        page.wait_for_timeout(300)
        width = page.evaluate("document.documentElement.scrollWidth")
        assert width <= 390, f"{route} is {width} wide, and has to be moved sideways"
        tab.shoot(f"telephone{re.sub('[#/]+', '-', route)}")
