"""The animation of `esail animate`: number, duration and size of its pictures, and what they show."""

import builtins
import importlib.util
import itertools

import numpy as np
import pytest
from PIL import Image

from esail_jax import cli
from esail_jax.viewing.colour_scale import colours_of
from esail_jax.viewing.drawing import Drawing, Style, plain, statement
from esail_jax.viewing.motions import read_motions
from support.motion_files import TIME
from support.new_process import output_of

STYLE = Style(exaggeration=5.0, axes="inertial", colour="tension", width=320, height=240)

SHORT = ["--fps", "10", "--seconds", "0.5", "--size", "320x240"]
"""Options for five pictures of half a second in all, 320 by 240 pixels."""

NEAR = 30
"""Largest difference of a colour channel (0 to 255) that still counts as the same colour: the edges of
lines are smoothed."""


def frames_of(path):
    """The pictures of an animation, (frame, height, width, 3), and their durations [ms]."""
    with Image.open(path) as image:
        pictures, durations = [], []
        for k in range(image.n_frames):
            image.seek(k)
            image.load()
            pictures.append(np.asarray(image.convert("RGB")).astype(int))
            durations.append(image.info["duration"])
    return np.array(pictures), durations


def animate(run, path, *options):
    """Runs the command with SHORT and other options."""
    assert cli.main(["animate", str(run), "-o", str(path), *SHORT, *options]) == 0
    return path


@pytest.mark.parametrize("suffix", ["webp", "gif"])
@pytest.mark.parametrize("kind", ["sail", "chain"])
def test_an_animation_has_the_pictures_that_were_asked_for(kind, suffix, request, tmp_path):
    path = animate(request.getfixturevalue(kind), tmp_path / f"run.{suffix}")
    pictures, durations = frames_of(path)
    assert pictures.shape == (5, 240, 320, 3) and durations == 5 * [100]
    moved = [np.abs(a - b).max() for a, b in itertools.pairwise(pictures)]
    assert min(moved) > 100, "every picture differs from the one before"


@pytest.mark.nightly
def test_a_run_of_few_instants_lasts_as_long(sail, tmp_path):
    """Forty-one saved instants in 4.1 s are ten pictures per second, whatever was asked for."""
    path = animate(sail, tmp_path / "run.webp", "--fps", "50", "--seconds", "4.1")
    pictures, durations = frames_of(path)
    assert len(pictures) == len(TIME) and set(durations) == {100}


@pytest.mark.parametrize("suffix", ["webp", "gif"])
def test_an_animation_lasts_as_long_as_it_shall(suffix, sail, tmp_path):
    """Fifteen pictures a second are no whole number of milliseconds, nor of the hundredths of a GIF."""
    path = animate(sail, tmp_path / f"run.{suffix}", "--fps", "15", "--seconds", "1", "--size", "64x64")
    durations = frames_of(path)[1]
    assert len(durations) == 15 and sum(durations) == 1000


@pytest.mark.parametrize(
    ("suffix", "how", "line"),
    [
        ("gif", ["--seconds", "1e300"], "`--seconds` must be 24600 at most for 41 pictures, but is 1e+300"),
        ("webp", ["--seconds", "1e300", "--fps", "1e300"], "`--seconds` must be 24600 at most"),
        ("mp4", ["--size", "65x64"], "`--size` must be even in a .mp4 file, but is 65x64"),
    ],
)
def test_what_a_format_cannot_hold_is_refused(suffix, how, line, sail, tmp_path, capsys):
    assert cli.main(["animate", str(sail), "-o", str(tmp_path / f"run.{suffix}"), *how]) == 2
    assert capsys.readouterr().err.startswith(line) and not list(tmp_path.iterdir())


def test_tethers_have_the_colour_of_their_tension(sail):
    """In the middle of every drawn tether the picture has the colour of the scale."""
    (motion,) = read_motions([sail], (), 1000)
    style = Style(1.0, "inertial", "tension", 640, 480)
    drawing, frame = Drawing(motion, style), 12
    image = drawing.image(frame).astype(int)
    colours = colours_of(motion.colours["tension"].values[frame], *drawing.range)
    points = motion.vertices[frame] @ drawing.orientations(frame)[0].T
    for line, colour in zip(motion.lines, colours, strict=True):
        column, row = drawing.camera.project(points[line[4]][None])[0].round().astype(int)
        nearby = image[row - 1 : row + 2, column - 1 : column + 2].reshape(-1, 3)
        assert np.abs(nearby - colour).max(1).min() < NEAR


def test_spinning_axes_hold_the_roots_still(sail):
    """In the hub's axes a tether moves little, in inertial axes it turns; the wind does the opposite."""
    (motion,) = read_motions([sail], (), 1000)
    lines = {}
    for axes in ("inertial", "spinning"):
        drawing = Drawing(motion, Style(1.0, axes, "tension", 320, 240))
        turned = [drawing.orientations(frame) for frame in (0, 20)]
        body, wind = ([pair[k] for pair in turned] for k in (0, 1))
        lines[axes] = np.abs(body[1] - body[0]).max(), np.abs(wind[1] - wind[0]).max()
    assert lines["spinning"][0] < 1e-12 < 1.0 < lines["spinning"][1]
    assert lines["inertial"][1] < 1e-12 < 1.0 < lines["inertial"][0]


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (14990.4, "14990"),
        (0.0, "0"),
        (0.0012345, "0.001234"),
        (-20000.0, "-20000"),
        (2.5e6, "2.500e+06"),
        (3e-7, "3.000e-07"),
    ],
)
def test_numbers_are_plain(number, text):
    """A voltage of 14,990 V is no 1.499e+04 V."""
    assert plain(number) == text


def test_the_exaggeration_is_stated(sail, chain):
    (motion,) = read_motions([sail], (), 5)
    assert statement(motion, STYLE) == "lateral displacements × 5, inertial axes, centred on the hub"
    (motion,) = read_motions([chain], (), 5)
    assert statement(motion, Style(1.0, "inertial", None, 320, 240)) == "true shape"
    texts = [text.get_text() for text in Drawing(motion, STYLE).figure.texts]
    assert statement(motion, STYLE) in texts and "; ".join(motion.remarks) in texts


def test_a_run_without_colours_is_drawn(sail):
    (motion,) = read_motions([sail], (), 3)
    assert Drawing(motion, Style(2.0, "spinning", "none", 320, 240)).image(0).std() > 0.0


def test_a_movie_needs_a_library(sail, tmp_path, capsys, monkeypatch):
    """Without imageio-ffmpeg the answer is one line that names the extra."""
    real = builtins.__import__

    def missing(name, *rest, **more):
        if name == "imageio_ffmpeg":
            raise ImportError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", missing)
    assert cli.main(["animate", str(sail), "-o", str(tmp_path / "run.mp4")]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and "esail_jax[movie]" in line
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(
    importlib.util.find_spec("imageio_ffmpeg") is None, reason="MP4 needs imageio-ffmpeg, which is missing"
)
def test_a_movie_has_the_pictures_that_were_asked_for(sail, tmp_path):
    """In a process of its own: the library forks, which JAX's threads do not allow."""
    arguments = ["animate", str(sail), "-o", str(tmp_path / "run.mp4"), *SHORT]
    code = f"""
import imageio_ffmpeg
from esail_jax.cli import main
assert main({arguments}) == 0
print(*imageio_ffmpeg.count_frames_and_secs({str(tmp_path / "run.mp4")!r}))
"""
    assert output_of(code).splitlines()[-1] == "5 0.5"
