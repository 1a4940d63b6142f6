"""The colours of the package's figures: one style sheet, and what colour-blind readers see of it."""

from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from esail_jax import plotting
from esail_jax.plotting.panels import tether_colours
from esail_jax.plotting.style import BLUE, ORANGE, RED, SHEET, styled

SEEN = {
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                   [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                     [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                   [0.004733, 0.691367, 0.303900]],
}  # fmt: skip
"""What is seen of linear RGB without one kind of cone (Machado, Oliveira and Fernandes, 2009, Table 1)."""

TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
"""CIE XYZ of linear sRGB."""


def least_difference(colours, kind):
    """The least CIE 1976 colour difference of two of the colours as seen by a reader."""
    c = np.array([to_rgb(colour) for colour in colours])
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    xyz = np.clip(linear @ np.transpose(SEEN[kind]), 0.0, 1.0) @ TO_XYZ.T / [0.9505, 1.0, 1.089]
    x, y, z = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16.0 / 116.0).T
    lab = np.stack([116.0 * y, 500.0 * (x - y), 200.0 * (y - z)], axis=1)
    return min(np.linalg.norm(a - b) for i, a in enumerate(lab) for b in lab[:i])


@pytest.mark.parametrize("kind", SEEN)
def test_colour_blind_readers_tell_the_colours_apart(kind):
    """A difference of 2.3 is just noticed. The ten colours of the sheet differ by 15 at least; of
    matplotlib's own, two differ by 4.6 for a reader without red cones. Neighbours among twelve tethers
    differ by 5."""
    assert least_difference(SHEET["axes.prop_cycle"].by_key()["color"], kind) > 15.0
    assert least_difference(tether_colours(12), kind) > 5.0


def test_lines_have_the_colours_of_the_sheet():
    """The sheet is one that matplotlib finds by its name, for figures of a user's own. Lines without a
    colour of their own get its colours in the figures of the package, and elsewhere those of the user. No
    figure of the package names one of matplotlib's own colours."""
    with pyplot.style.context("esail_jax.plotting.esail"):
        used = matplotlib.rcParams["axes.prop_cycle"].by_key()["color"]
    assert used[:3] == [BLUE, ORANGE, RED] and len(set(used)) == 10

    @styled
    def axes():
        return Figure().add_subplot()

    assert axes().plot([0.0, 1.0])[0].get_color() == BLUE
    assert Figure().add_subplot().plot([0.0, 1.0])[0].get_color() != BLUE
    sources = Path(plotting.__file__).parent.glob("*.py")
    assert not any('"tab:' in path.read_text(encoding="utf-8") for path in sources)
