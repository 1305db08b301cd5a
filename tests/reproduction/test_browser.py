"""The report in a browser. It needs Chromium and its driver; KOOP_BROWSER=required makes their absence a failure."""

from __future__ import annotations

import base64
import json
import os
import re
import shutil
import time
from pathlib import Path

import pytest

from koopcli.reproduction.texts import number_text

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
REQUIRED = os.environ.get("KOOP_BROWSER") == "required"
QUIET = (  # no screen, no sandbox inside a container, nothing looked up in the background
    "--headless=new",
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
)

pytestmark = pytest.mark.skipif(
    not (BROWSER and DRIVER) and not REQUIRED, reason="needs chromium and chromedriver (Debian: chromium-driver)"
)
SIZES = [(1280, 900), (390, 844), (360, 740)]  # a desk, and phones
SMALLEST = 9  # px


@pytest.fixture(scope="module")
def report(reproduced):
    """A report on tiny data, its path and its JSON."""
    found = json.loads(reproduced.with_suffix(".out").read_text())
    return Path(found["path"]), found


@pytest.fixture(scope="module")
def browser():
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for argument in (*QUIET, "--window-size=1280,900"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    yield driver
    driver.quit()


@pytest.fixture
def opened(browser, report):
    """The report as it is first seen, at a desk; whatever the browser complains of is a failure."""
    path, _ = report
    sized(browser, *SIZES[0])
    browser.get(path.as_uri())
    yield browser
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    assert browser.get_log("browser") == []


def sized(browser, width, height):
    about = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 800}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", about)


def until(browser, script, *arguments, seconds=60.0):
    """The first true result of ``script``."""
    end = time.monotonic() + seconds
    while not (found := browser.execute_script(script, *arguments)):
        assert time.monotonic() < end, f"never came true: {script}"
        time.sleep(0.1)
    return found


def test_it_loads_nothing_else_and_every_picture_is_whole(opened):
    loaded = opened.execute_script("return performance.getEntriesByType('resource').map(one => one.name)")
    assert [name for name in loaded if not name.startswith("data:")] == []
    until(opened, "return [...document.images].every(one => one.complete)")
    assert opened.execute_script("return [...document.images].filter(one => !one.naturalWidth).length") == 0


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_first_screen_has_the_first_picture_and_no_page_scrolls_sideways(opened, width, height):
    sized(opened, width, height)
    until(opened, "return innerWidth === arguments[0]", width)
    opened.execute_script("document.querySelectorAll('details').forEach(one => { one.open = true; })")
    opened.execute_script("document.querySelectorAll('header details').forEach(one => { one.open = false; })")
    assert opened.execute_script("return document.documentElement.scrollWidth") <= width
    numbers, picture, ghosts = (
        opened.execute_script("return document.querySelector(arguments[0]).getBoundingClientRect().bottom", part)
        for part in (".numbers", "figure img", ".ghosts svg")
    )
    assert max(numbers, picture) <= height or height < 800  # the smallest phone scrolls
    assert ghosts <= height or width < 1280
    small = opened.execute_script(
        """
        const said = node => [...node.childNodes].some(one => one.nodeType === 3 && one.textContent.trim());
        return [...document.body.querySelectorAll("*")].filter(one => one.checkVisibility() && said(one))
          .filter(one => parseFloat(getComputedStyle(one).fontSize) < arguments[0]).map(one => one.outerHTML);
        """,
        SMALLEST,
    )
    assert small == []


def test_no_table_is_wider_than_its_frame_at_a_desk_and_points_are_in_line(opened):
    opened.execute_script("document.querySelectorAll('details').forEach(one => { one.open = true; })")
    wide = "return [...document.querySelectorAll('.wide')].filter(one => one.scrollWidth > one.clientWidth).length"
    assert opened.execute_script(wide) == 0
    places = opened.execute_script(
        """
        const rows = [...document.querySelectorAll(".numbers tbody tr")];
        return rows.map(row => {
          const text = document.createTreeWalker(row.cells[2], NodeFilter.SHOW_TEXT);
          while (text.nextNode()) {
            const at = text.currentNode.data.indexOf(".");
            if (at < 0) continue;
            const range = document.createRange();
            range.setStart(text.currentNode, at);
            range.setEnd(text.currentNode, at + 1);
            return range.getBoundingClientRect().left;
          }
        }).filter(place => place !== undefined);
        """
    )
    assert len(places) > 2
    assert max(places) - min(places) < 1


def test_on_a_phone_the_first_column_of_a_wide_table_stays(opened):
    sized(opened, *SIZES[1])
    left = opened.execute_script(
        """
        const frame = document.querySelector(".every .wide");
        frame.closest("details").open = true;
        frame.scrollLeft = 200;
        return [frame.scrollLeft, frame.querySelector("tbody th").getBoundingClientRect().left
          - frame.getBoundingClientRect().left];
        """
    )
    assert left == [200, 0]


def test_ghosts_follow_the_slider(opened):
    read = """
        const slider = document.querySelector(".controls input");
        if (arguments[0] !== null) {
          slider.value = arguments[0];
          slider.dispatchEvent(new Event("input"));
        }
        return [document.querySelector(".controls output").textContent,
          ...[...document.querySelectorAll(".car")].map(one => one.getAttribute("transform")),
          ...[...document.querySelectorAll(".off")].map(one => one.textContent)];
    """
    end = opened.execute_script(read, None)
    start = opened.execute_script(read, 0)
    assert start[0] == "0.00 s"
    assert set(start[1:4]) == {"translate(0 0) rotate(0)"}
    assert start[4:] == ["0 m off"] * 2
    soon = opened.execute_script(read, 4)
    assert soon[0] == "0.04 s"
    assert start[1] not in soon[1:4]
    assert soon[4:] != start[4:]
    last = opened.execute_script(read, 10_000)  # the last there is
    assert last[0] == end[0] == "0.80 s"


def test_a_click_enlarges_and_a_button_copies(opened):
    picture = opened.find_element("css selector", "figure img")
    picture.click()
    large = opened.find_element("css selector", "dialog[open] img")
    assert large.size["width"] > 1.5 * picture.size["width"]
    large.click()
    assert not opened.find_elements("css selector", "dialog[open]")
    opened.execute_cdp_cmd("Browser.grantPermissions", {"permissions": ["clipboardReadWrite"]})
    line = opened.find_element("css selector", "footer .command")
    opened.execute_script("arguments[0].scrollIntoView({behavior: 'instant', block: 'center'})", line)
    line.find_element("css selector", "button").click()
    until(opened, "return arguments[0].textContent === 'Copied'", line.find_element("css selector", "button"))
    copied = opened.execute_async_script("navigator.clipboard.readText().then(arguments[0])")
    assert copied == line.find_element("css selector", "code").text
    assert copied.startswith("koop reproduce all --experiment ")


def test_the_tables_hold_the_numbers_of_the_json(opened, report):
    _, found = report
    cells = opened.execute_script(
        "return [...document.querySelectorAll('.every tbody tr')].map(row => [...row.cells].map(c => c.textContent))"
    )
    rows = {row[-1]: row for row in cells}
    evaluations = [cell for run in found["runs"] for cell in run["evaluations"]]
    assert {cell["name"] for cell in evaluations} == set(rows)
    for cell in evaluations:
        assert number_text(cell["rmse"]["mean"]) in rows[cell["name"]]


def test_print_cuts_no_figure_and_opens_the_tables(opened):
    """Links at the top and at the bottom of every figure tell on which page of the PDF each ends up."""
    figures = opened.execute_script(
        """
        const figures = [...document.querySelectorAll("figure, .ghosts")];
        figures.forEach((figure, i) => {
          figure.style.position = "relative";
          for (const end of ["top", "bottom"]) {
            const link = document.createElement("a");
            link.href = `http://figure/${i}/${end}`;
            link.textContent = "x";
            link.style.cssText = `position:absolute;left:0;${end}:0;font-size:2px;line-height:1`;
            figure.append(link);
          }
        });
        return figures.length;
        """
    )
    pdf = base64.b64decode(
        opened.execute_cdp_cmd("Page.printToPDF", {"paperWidth": 8.27, "paperHeight": 11.69})["data"]
    )
    objects = dict(re.findall(rb"\n(\d+) 0 obj\n(.*?)endobj", pdf, re.DOTALL))
    places = {}
    for number, body in objects.items():
        if b"/Type /Page\n" in body or b"/Type /Page/" in body:
            annotations = re.search(rb"/Annots \[(.*?)\]", body, re.DOTALL)
            for one in re.findall(rb"(\d+) 0 R", annotations[1] if annotations else b""):
                link = re.search(rb"/URI \(http://figure/(\d+)/(\w+)\)", objects[one])
                if link:
                    places.setdefault(int(link[1]), set()).add(number)
    assert set(places) == set(range(figures))
    assert {figure for figure, pages in places.items() if len(pages) > 1} == set()
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    heights = opened.execute_script(
        "return [...document.querySelectorAll('.folded table')].map(one => one.offsetHeight)"
    )
    assert min(heights) > 0


def test_without_javascript_everything_is_there(browser, report):
    path, found = report
    browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    try:
        sized(browser, *SIZES[0])
        browser.get(path.as_uri())
        pictures = browser.find_elements("css selector", "figure img")
        assert len(pictures) == len(found["figures"])
        assert all(one.size["height"] > 100 for one in pictures)
        assert browser.find_element("css selector", ".ghosts svg").size["height"] > 100
        assert len(browser.find_elements("css selector", ".ghosts .car")) == 3
        assert " m off" in browser.find_element("css selector", ".ghosts p").text
        assert not browser.find_elements("css selector", "button, input, dialog")  # nothing that does nothing
    finally:
        browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})
