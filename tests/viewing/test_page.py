"""The page of `esail view`: what is packed in it, that nothing can leave it, and how it behaves.

Three levels, each as far as the machine has the tools (the reasons of skipped ones are in the summary of
pytest): the text of the page; its functions that draw nothing, under node, compared with those in Python;
and, in `test_page_in_browser.py`, the page in a headless browser."""

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
from support.motion_files import TIME, sail_rows, sail_scene, write_run

SINGLE = float(np.finfo(np.float32).eps)
"""Relative rounding of a packed number."""


def unpacked(entry):
    """The array that the page packs."""
    return np.frombuffer(base64.b64decode(entry["data"]), "<f4").reshape(entry["shape"])


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
  placed: pure.placedTexts([[10, ["long text", "1"]], [60, ["long text", "2"]], [110, ["long text", "3"]],
    [210, ["long text", "4"]], [380, ["long text", "5"]]], 400, (text) => 10 * text.length),
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
    # Ten pixels a letter. The second text would cover the first. The last one has no room to its right, and
    # its long version would cover the one before.
    assert found["placed"] == [[10, "long text"], [110, "long text"], [210, "long text"], [380, "5"]]
    assert found["digits"] == ["0.012346", "12346", "4.0000e-7", "0", "\u2013"]
