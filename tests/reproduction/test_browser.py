"""The report in a browser. It needs Chromium and its driver; KOOP_BROWSER=required makes their absence a failure."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import time

import pytest

from tests import stock
from tests.conftest import TINY
from tests.reproduction.pages import Page

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
REQUIRED = os.environ.get("KOOP_BROWSER") == "required"
QUIET = (  # no screen, no sandbox inside a container, nothing looked up in the background; a card drawn in software
    "--headless=new",
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--enable-unsafe-swiftshader",
)

pytestmark = pytest.mark.skipif(
    not (BROWSER and DRIVER) and not REQUIRED, reason="needs chromium and chromedriver (Debian: chromium-driver)"
)
VIEW = "figure[data-figure=error-map] .view"


@pytest.fixture(scope="module")
def report(tmp_path_factory, reproduced):
    """A report on tiny data, its path and its JSON."""
    work = tmp_path_factory.mktemp("report")
    (work / "tiny.toml").write_text(TINY)
    stock.link(reproduced, work / "store")
    command = [sys.executable, "-m", "koopcli", "reproduce", "--experiment", "tiny.toml", "--json", "--store", "store"]
    done = subprocess.run(command, cwd=work, capture_output=True, text=True, check=True)
    found = json.loads(done.stdout)
    return work / found["path"], found


@pytest.fixture(scope="module")
def browser():
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for argument in (*QUIET, "--window-size=1200,900"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def opened(browser, report):
    path, _ = report
    browser.get(path.as_uri())
    until(browser, "return document.querySelector(arguments[0])?._fullLayout?.scene?._scene?.glplot != null", VIEW)
    return browser


def until(browser, script, *arguments, seconds=60.0):
    """The first true result of ``script``."""
    end = time.monotonic() + seconds
    while not (found := browser.execute_script(script, *arguments)):
        assert time.monotonic() < end, f"never came true: {script}"
        time.sleep(0.1)
    return found


def test_it_opens_without_a_complaint_and_loads_nothing_else(opened):
    complaints = [entry for entry in opened.get_log("browser") if entry["level"] in ("SEVERE", "ERROR")]
    assert complaints == []
    loaded = opened.execute_script("return performance.getEntriesByType('resource').map(one => one.name)")
    assert [name for name in loaded if not name.startswith("data:")] == []
    broken = opened.execute_script("return [...document.images].filter(one => !one.naturalWidth).length")
    assert broken == 0


def test_no_button_sends_anything_away(opened):
    buttons = opened.execute_script(
        "return [...document.querySelectorAll(arguments[0] + ' .modebar-btn')].map(one => one.dataset.title)", VIEW
    )
    assert len(buttons) == 5
    assert not [title for title in buttons if re.search("share|cloud|edit|upload", title, re.IGNORECASE)]


def test_the_view_stands_for_the_picture_and_can_be_turned(opened):
    from selenium.webdriver import ActionChains

    view = opened.find_element("css selector", VIEW)
    picture = opened.find_element("css selector", "figure[data-figure=error-map] img")
    assert view.is_displayed()
    assert not picture.is_displayed()
    opened.execute_script("arguments[0].scrollIntoView({block: 'center'})", view)
    camera = "return JSON.stringify(document.querySelector(arguments[0])._fullLayout.scene._scene.getCamera().eye)"
    before = opened.execute_script(camera, VIEW)
    ActionChains(opened).move_to_element(view).click_and_hold().move_by_offset(120, 40).release().perform()
    until(opened, f"const now = (() => {{ {camera} }})(...arguments); return now !== arguments[1]", VIEW, before)


def test_a_ball_tells_its_error_under_the_pointer(opened):
    """Every ball is tried where it is drawn, until one answers: others may lie in front of it."""
    from selenium.webdriver import ActionChains

    view = opened.find_element("css selector", VIEW)
    opened.execute_script("arguments[0].scrollIntoView({block: 'center'})", view)
    spots = opened.execute_script(
        """
        const view = document.querySelector(arguments[0]);
        const scene = view._fullLayout.scene._scene, {model, view: eye, projection} = scene.glplot.cameraParams;
        const times = (m, v) => [0, 1, 2, 3].map(i => m[i]*v[0] + m[i+4]*v[1] + m[i+8]*v[2] + m[i+12]*v[3]);
        const size = scene.container.getBoundingClientRect(), whole = view.getBoundingClientRect();
        const balls = view.data.find(one => one.mode === "markers");
        return balls.x.map((x, i) => {
          const data = [x, balls.y[i], balls.z[i]].map((value, k) => value * scene.dataScale[k]);
          const p = times(projection, times(eye, times(model, [...data, 1])));
          return [size.left - whole.left + size.width * (p[0]/p[3] + 1) / 2 - whole.width / 2,
                  size.top - whole.top + size.height * (1 - p[1]/p[3]) / 2 - whole.height / 2];
        });
        """,
        VIEW,
    )
    read = "return document.querySelector(arguments[0]).querySelector('.hovertext')?.textContent"
    said = ""
    for x, y in reversed(spots):
        ActionChains(opened, duration=50).move_to_element_with_offset(view, x, y).perform()
        time.sleep(0.3)
        said = opened.execute_script(read, VIEW)
        if said:
            break
    assert "RMSE" in said
    assert "rad/s" in said
    assert "from the data" in said


def test_the_tables_hold_the_numbers_of_the_json(opened, report):
    _, found = report
    cells = opened.execute_script(
        "return [...document.querySelectorAll('.every tbody tr')].map(row => [...row.cells].map(c => c.textContent))"
    )
    rows = {row[-1]: row for row in cells}
    evaluations = [cell for run in found["runs"] for cell in run["evaluations"]]
    assert {cell["name"] for cell in evaluations} == set(rows)
    for cell in evaluations:
        assert f"{cell['rmse']['mean']:.4g}" in rows[cell["name"]]
    page = Page(opened.page_source.replace("<!DOCTYPE html>", ""))
    assert len(page.figures) == len(found["figures"])


@pytest.mark.parametrize("width", [360, 800])
def test_it_fits_a_phone(opened, width):
    opened.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": 740, "deviceScaleFactor": 2, "mobile": True},
    )
    try:
        until(opened, "return innerWidth === arguments[0]", width)
        assert opened.execute_script("return document.documentElement.scrollWidth") == width
        sizes = opened.execute_script("return [...document.querySelectorAll('figure')].map(one => one.clientWidth)")
        assert max(sizes) <= width
    finally:
        opened.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_in_print_the_picture_comes_back(opened):
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    try:
        assert not opened.find_element("css selector", VIEW).is_displayed()
        assert opened.find_element("css selector", "figure[data-figure=error-map] img").is_displayed()
    finally:
        opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
