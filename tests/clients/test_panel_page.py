"""The panel's page itself: what it draws, tells, keeps and gives, and that everybody can use it."""

import re

from playwright.sync_api import expect

from panel import RIG, PanelRig, Tab, browser, rig, tab, tabs, until  # noqa: F401

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
    expect(tip).to_contain_text("docs/registers.md#")
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
    expect(page.locator("#plot-pause")).to_have_text("Go on")
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


def test_a_value_that_the_controller_refuses_is_said_at_its_field(tab, rig):
    page = tab.open("#/axis/stage/settings")
    page.get_by_label("IP", exact=True).fill("300.1.1.1")
    page.locator("#apply").click()
    expect(page.locator("#set-IP-error")).not_to_have_text("")
    expect(page.get_by_label("IP", exact=True)).to_have_attribute("aria-invalid", "true")


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
