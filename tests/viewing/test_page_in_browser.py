"""How the page of `esail view` behaves in a headless browser. Without one these tests are skipped."""

import re

import numpy as np
import pytest

from esail_jax.viewing.motions import read_motions
from esail_jax.viewing.page import page_of
from support.browser import Browser, browser_path
from support.motion_files import TIME, chain_rows, released_run, sail_rows


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    program = browser_path()
    if program is None:
        pytest.skip("the page's behaviour needs a browser (Debian: chromium), which is missing")
    found = Browser(program, tmp_path_factory.mktemp("browser"))
    yield found
    found.close()


@pytest.fixture
def shown(browser, page, tmp_path):
    """The sail's page in the browser. Whatever a test does, the page asks for nothing but itself and has
    no complaints."""
    path = tmp_path / "page.html"
    path.write_text(page, encoding="utf-8")
    browser.requests.clear()
    browser.complaints.clear()
    browser.open(path)
    yield browser
    assert browser.requests == [path.as_uri()]
    assert browser.complaints == []


def numbers_in(text):
    """The numbers in a text but those of tethers and rods."""
    text = re.sub(r"(tether|rod) \d+", "", text)
    return [float(x) for x in re.findall(r"-?\d+(?:\.\d+)?(?:e[-+]\d+)?", text)]


def test_the_slider_moves_the_sail_and_the_numbers_are_those_of_the_run(shown):
    """Numbers are shown with five digits: they agree to half of the last one."""
    rows, before = sail_rows(), shown.picture()
    frame = 17
    shown.choose("slider", str(frame), "input")
    assert shown.picture() != before
    assert numbers_in(shown.text("time")) == [TIME[frame]]
    for plot, name in (("first", "thrust_O"), ("second", "kinetic_energy"), ("first", "voltage")):
        shown.choose(f"{plot}-name", name)
        values = np.atleast_1d(rows[name][frame])
        words = shown.text(f"{plot}-value")
        assert np.allclose(numbers_in(words), values, rtol=6e-5, atol=0), (name, words)
    tension = np.linalg.norm(rows["reaction_B"], axis=-1)
    ends = numbers_in(shown.text("low")) + numbers_in(shown.text("high"))
    assert np.allclose(ends, [tension.min(), tension.max()], rtol=6e-5, atol=0), "the range is locked"


def test_controls_change_the_picture_and_say_so(shown):
    """Axes, exaggeration, colour, and a range of this instant in place of that of the run."""
    shown.choose("slider", "13", "input")
    pictures = [shown.picture()]
    for control, value in (("axes", "spinning"), ("exaggeration", "20"), ("colour", "strain")):
        shown.choose(control, value)
        pictures.append(shown.picture())
    assert len(set(pictures)) == 4
    assert shown.text("statement") == "lateral displacements × 20, spinning axes, centred on the hub"
    shown.value("document.getElementById('locked').click()")
    shown.settle()
    strain = sail_rows()["max_axial_strain"][13]
    ends = numbers_in(shown.text("low")) + numbers_in(shown.text("high"))
    assert np.allclose(ends, [strain.min(), strain.max()], rtol=6e-5, atol=0)
    shown.choose("exaggeration", "1")
    assert shown.text("statement").startswith("true shape")


def test_the_mouse_turns_and_enlarges_the_sail(shown):
    first = shown.picture()
    shown.mouse("mousePressed", 500, 250, button="left", clickCount=1)
    shown.mouse("mouseMoved", 560, 270, button="left", buttons=1)
    shown.mouse("mouseReleased", 560, 270, button="left", clickCount=1)
    shown.settle()
    turned = shown.picture()
    shown.mouse("mouseWheel", 500, 250, deltaX=0, deltaY=-300)
    shown.settle()
    assert len({first, turned, shown.picture()}) == 3
    shown.value("document.getElementById('picture-0').dispatchEvent(new MouseEvent('dblclick'))")
    assert shown.picture() == first, "a double click brings the first view back"


def test_play_moves_the_slider(shown):
    shown.value("document.getElementById('play').click()")
    moved = "new Promise((done) => { const look = () => Number(document.getElementById('slider').value) > 0"
    shown.value(f"{moved} ? done(true) : requestAnimationFrame(look); look(); }})")
    shown.value("document.getElementById('play').click()")
    assert shown.text("play") == "Play"


def test_dark_and_light(shown):
    """The page follows the colours that the user prefers, also after it is loaded."""
    ground = "getComputedStyle(document.body).backgroundColor"
    found = []
    for scheme in ("light", "dark"):
        shown.colours(scheme)
        shown.settle()
        found.append((shown.value(ground), shown.picture()))
    assert found[0][0] == "rgb(255, 255, 255)" != found[1][0]
    assert found[0][1] != found[1][1], "the picture is drawn again"


def test_two_runs_side_by_side_share_the_clock(browser, sail, ensemble, tmp_path):
    """Every run shows its own saved instant that is nearest to the time of the longest one."""
    motions = read_motions([sail], (), 1000) + read_motions([sail], (), 5)
    path = tmp_path / "two.html"
    path.write_text(page_of(motions), encoding="utf-8")
    browser.open(path, 1200, 800)
    browser.choose("slider", "17", "input")
    browser.choose("first-name", "voltage")
    lines = browser.value("[...document.getElementById('first-value').children].map((x) => x.textContent)")
    rows = sail_rows()["voltage"]
    for line, frame in zip(lines, (17, 20), strict=True):
        words = line.partition("):")[2]
        assert np.allclose(numbers_in(words)[0], rows[frame, 0], rtol=6e-5, atol=0)
    assert browser.picture(0) != browser.picture(1) and browser.complaints == []


def test_a_narrow_window_needs_no_sideways_scrolling(shown):
    shown.call(
        "Emulation.setDeviceMetricsOverride", width=380, height=800, deviceScaleFactor=1, mobile=False
    )
    shown.settle()
    assert shown.value("document.documentElement.scrollWidth") <= 380


@pytest.mark.parametrize("release", [False, True])
def test_a_window_of_a_laptop_needs_no_scrolling(browser, sail, folder, tmp_path, release):
    """1200 x 900 pixels hold the whole page, also with the longer caption of a run with a release."""
    path = tmp_path / "page.html"
    run = released_run(folder) if release else sail
    path.write_text(page_of(read_motions([run], (), 1000)), encoding="utf-8")
    browser.open(path, 1200, 900)
    assert browser.value("document.documentElement.scrollHeight") <= 900


def test_numbers_of_a_released_tether_are_left_out_of_ranges(browser, folder, tmp_path):
    """The extremes of all tethers become those of the attached ones; the caption says that it is free."""
    path = tmp_path / "released.html"
    path.write_text(page_of(read_motions([released_run(folder, 5)], (), 1000)), encoding="utf-8")
    browser.complaints.clear()
    browser.open(path)
    browser.choose("first-name", "voltage")
    for frame, held, word in ((0, [0, 1, 2, 3, 4], "all"), (40, [0, 2, 3, 4], "attached")):
        browser.choose("slider", str(frame), "input")
        volts, words = sail_rows(5)["voltage"][frame], browser.text("first-value")
        expected = [volts[0], volts[held].min(), volts[held].max()]
        assert word in words and np.allclose(numbers_in(words), expected, rtol=6e-5, atol=0)
    caption = browser.value("document.querySelector('figcaption').textContent")
    assert "tether 2: grey when released, may leave the picture" in caption
    assert browser.complaints == []


def test_a_single_instant_is_shown(browser, sail, tmp_path):
    """A run that failed at once has one row."""
    path = tmp_path / "one.html"
    path.write_text(page_of(read_motions([sail], (), 1)), encoding="utf-8")
    browser.complaints.clear()
    browser.open(path)
    assert numbers_in(browser.text("time")) == [0.0] and browser.complaints == []


def test_a_chain_moves(browser, chain, tmp_path):
    path = tmp_path / "chain.html"
    path.write_text(page_of(read_motions([chain], (), 1000)), encoding="utf-8")
    browser.complaints.clear()
    browser.open(path)
    before = browser.picture()
    browser.choose("slider", "20", "input")
    assert browser.picture() != before and browser.complaints == []
    tension = chain_rows()["tension"][20]
    words = browser.text("first-value")
    assert np.allclose(numbers_in(words), [tension[0], tension.min(), tension.max()], rtol=6e-5, atol=0)
    assert browser.value("document.getElementById('axes-choice').hidden")
