"""The page of `esail view`: what is packed in it, that nothing can leave it, and how it behaves.

Three levels, each as far as the machine has the tools (the reasons of skipped ones are in the summary of
pytest): the text of the page; its functions that draw nothing, under node, compared with those in Python;
and the page in a headless browser."""

import base64
import dataclasses
import hashlib
import json
import re
import shutil
import subprocess

import numpy as np
import pytest

from esail_jax.viewing.camera import Camera
from esail_jax.viewing.colour_scale import NONE, STOPS, colours_of
from esail_jax.viewing.motion import exaggerated
from esail_jax.viewing.motions import read_motions
from esail_jax.viewing.page import checksum, packed, page_of, part
from support.browser import Browser, browser_path
from support.motion_files import TIME, chain_rows, released_run, sail_rows, sail_scene, write_run

SINGLE = float(np.finfo(np.float32).eps)
"""Relative rounding of a packed number."""


def unpacked(entry):
    """Returns the array that the page packs."""
    return np.frombuffer(base64.b64decode(entry["data"]), "<f4").reshape(entry["shape"])


@pytest.fixture(scope="module")
def page(sail):
    return page_of(read_motions([sail], (), 1000))


@pytest.fixture(scope="module")
def data(page):
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page)[1])


# ---- text -------------------------------------------------------------------------------------


def test_a_page_holds_the_numbers_of_the_run(data):
    """Times, signals and colours are those of the run file to the rounding of 32 bits; the last vertex of
    every tether, turned to inertial axes, is its tip relative to the hub."""
    rows, (run,) = sail_rows(), data["runs"]
    assert np.allclose(unpacked(run["time"]), TIME, rtol=SINGLE, atol=0)
    for name in ("coning_angle", "lagging_angle", "voltage", "kinetic_energy", "thrust_O"):
        signal = unpacked(run["signals"][name]["values"])
        signal = np.radians(signal) if run["signals"][name]["unit"] == "deg" else signal
        assert np.allclose(signal.reshape(rows[name].shape), rows[name], rtol=2 * SINGLE, atol=0), name
    vertices = unpacked(run["vertices"])[:, run["markers"]]
    tips = np.einsum("tib,tnb->tni", unpacked(run["rotation"]), vertices)
    exact = rows["tip_position_I"] - rows["hub_position_I"][:, None]
    assert np.abs(tips - exact).max() < 10.0 * SINGLE * np.abs(exact).max()


def test_signals_have_the_symbols_of_the_run_file_and_the_units_of_the_figures(data):
    (run,) = data["runs"]
    coning = run["signals"]["coning_angle"]
    assert (coning["unit"], coning["symbol"]) == ("deg", "gamma")
    assert coning["labels"] == ["tether 1", "tether 2", "tether 3"]
    assert run["signals"]["thrust_O"]["labels"] == ["x", "y", "z"]
    assert "tip_position_I" not in run["signals"]


def test_nothing_can_leave_the_page(page):
    """The policy allows the page's own script and style, told by their checksums, and no request at all.
    No address stands in the page."""
    (policy,) = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    (style,) = re.findall(r"<style>(.*?)</style>", page, flags=re.DOTALL)
    (script,) = re.findall(r"<script>(.*?)</script>", page, flags=re.DOTALL)
    for text, rule in ((style, "style-src"), (script, "script-src")):
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert rules.pop(rule) == f"'sha256-{digest}'" == checksum(text)
    nothing = dict.fromkeys(("default-src", "base-uri", "form-action"), "'none'")
    assert rules == nothing | {"img-src": "data:"}
    assert not re.search(r"https?:|//\w+\.|\bfetch\b|XMLHttpRequest|\bimport\b", page)


def test_text_of_a_run_cannot_become_part_of_the_page(sail):
    """A file may be called anything."""
    (motion,) = read_motions([sail], (), 2)
    object.__setattr__(motion, "title", "</script><b>&@DATA@")
    page = page_of([motion])
    assert "<b>" not in page and page.count("</script>") == 2
    assert "<title>&lt;/script&gt;&lt;b&gt;&amp;@DATA@</title>" in page


def test_options_are_the_first_state_of_the_page(sail, chain):
    motions = read_motions([sail], (), 5)
    text = page_of(motions, exaggeration=7.0, axes="spinning", colour="voltage")
    start = json.loads(re.search(r'id="data">(.*?)</script>', text)[1])["start"]
    assert (start["exaggeration"], start["axes"], start["colour"]) == (7.0, "spinning", "voltage")
    text = page_of(read_motions([chain], (), 5))
    start = json.loads(re.search(r'id="data">(.*?)</script>', text)[1])["start"]
    assert (start["exaggeration"], start["colour"]) == (1.0, "tension")


def test_rounding_errors_are_zero_and_angles_do_not_jump(folder):
    """Values of 1e-14 of the range are rounding errors. An angle of the hub that passes 180 degrees goes
    on, as in the figures; an angle after a gap is shown as it is."""
    turning = 2.0 * TIME / TIME[-1] * np.pi + 2.0
    angle = np.angle(np.exp(1j * turning))
    gap = np.where((TIME > 500.0) & (TIME < 700.0), np.nan, angle)
    coning = sail_rows()["coning_angle"]
    coning[0] = 1e-16
    rows = sail_rows() | {"coning_angle": coning, "precession_angle": angle, "thrust_angle": gap}
    (motion,) = read_motions([write_run(folder / "angles.h5", sail_scene(), TIME, rows)], (), 1000)
    signals = motion.signals
    assert (signals["coning_angle"].values[0] == 0.0).all() and signals["coning_angle"].unit == "deg"
    assert np.allclose(np.radians(signals["coning_angle"].values[1:]), coning[1:], rtol=1e-12, atol=0)
    shown = np.radians(signals["precession_angle"].values[:, 0])
    assert np.allclose(shown, turning, rtol=1e-12, atol=0)
    assert np.allclose(np.radians(signals["thrust_angle"].values[-1]), angle[-1], rtol=1e-12, atol=0)


# ---- functions under node ---------------------------------------------------------------------

CALLS = """
const given = JSON.parse(require("fs").readFileSync(0, "utf-8"));
const pure = require(given.file);
const camera = given.camera;
const turn = pure.turn(camera.yaw, camera.pitch);
const found = {
  decoded: Array.from(pure.decode(given.packed)),
  turn,
  pixels: given.points.map((p) => pure.project(pure.applied(turn, p), camera)),
  exaggerated: given.points.map((p, k) => pure.exaggerated(p, given.straight[k], given.factor)),
  colours: given.values.map((v) => pure.colourOf(v, -1, 2, given.stops, given.none)),
  constant: pure.colourOf(5, 5, 5, given.stops, given.none),
  product: pure.product(turn, pure.transposed(turn)),
  range: pure.rangeOf([3, NaN, -2, 7]),
  nearest: given.times.map((t) => pure.nearest([0, 1, 2.5, 4], t)),
  ticks: [pure.ticks(-0.0319, 0.0319), pure.ticks(0, 141), pure.ticks(19999, 20003)],
  digits: [0.0123456, 12345.678, 4e-7, 0, NaN].map(pure.digits),
};
console.log(JSON.stringify(found));
"""


@pytest.mark.skipif(shutil.which("node") is None, reason="the page's functions need node, which is missing")
def test_functions_of_the_page_agree_with_those_in_python(tmp_path):
    """Node evaluates the page's own file. Positions and colours agree to rounding (1e-12 of their size)."""
    (tmp_path / "pure.js").write_text(part("pure.js"), encoding="utf-8")
    rng = np.random.default_rng(0)
    points, straight = rng.normal(size=(20, 3)) * 8e3, rng.normal(size=(20, 3))
    straight /= np.linalg.norm(straight, axis=1, keepdims=True)
    values, numbers = np.linspace(-2.0, 3.0, 23), rng.normal(size=(4, 5))
    camera = Camera(0.7, -0.3, 9e3, 640.0, 480.0, 1.3)
    given = {
        "file": str(tmp_path / "pure.js"), "camera": dataclasses.asdict(camera),
        "packed": packed(numbers), "factor": 6.0,
        "points": points.tolist(), "straight": straight.tolist(), "values": values.tolist(),
        "stops": STOPS, "none": NONE, "times": [-1.0, 0.4, 0.6, 3.2, 3.3, 9.0],
    }  # fmt: skip
    ran = subprocess.run(
        ["node", "-e", CALLS], input=json.dumps(given), capture_output=True, text=True, check=True
    )
    found = json.loads(ran.stdout)
    assert np.array_equal(np.array(found["decoded"]).reshape(4, 5), numbers.astype(np.float32))
    turn = camera.turn()
    assert np.allclose(np.reshape(found["turn"], (3, 3)), turn, rtol=0, atol=1e-12)
    pixels, turned = np.array(found["pixels"]), points @ turn.T
    assert np.allclose(pixels[:, :2], camera.project(turned), rtol=1e-12, atol=1e-9)
    assert np.allclose(pixels[:, 2], camera.enlargement(turned), rtol=1e-12, atol=0)
    assert np.allclose(found["exaggerated"], exaggerated(points, straight, 6.0), rtol=1e-12, atol=1e-9)
    assert np.allclose(found["colours"], colours_of(values, -1.0, 2.0), rtol=0, atol=1e-9)
    assert np.allclose(found["constant"], colours_of(np.array(5.0), 5.0, 5.0), rtol=0, atol=1e-9)
    assert np.allclose(np.reshape(found["product"], (3, 3)), np.eye(3), rtol=0, atol=1e-12)
    assert found["range"] == [-2, 7] and found["nearest"] == [0, 0, 1, 2, 3, 3]
    assert found["ticks"] == [[-0.02, 0, 0.02], [0, 50, 100], [20000, 20002]]
    assert found["digits"] == ["0.012346", "12346", "4.0000e-7", "0", "\u2013"]


# ---- in a browser -----------------------------------------------------------------------------


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
    """Returns the numbers in a text but those of tethers and rods."""
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
