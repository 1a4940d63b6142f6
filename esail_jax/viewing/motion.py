"""`Motion`: what is drawn of a run, as plain arrays.

The picture consists of *lines* between *vertices*. The vertices of a sail have body axes B with the origin
at the hub centre; those of a chain have the axes of its scene."""

import dataclasses
from collections.abc import Mapping

import numpy as np


@dataclasses.dataclass(frozen=True)
class Quantity:
    """A quantity that colours the lines.

    label: in words; unit; values: (frame, line), NaN where a line has none."""

    label: str
    unit: str
    values: np.ndarray


@dataclasses.dataclass(frozen=True)
class Signal:
    """An observable against time.

    symbol: as in the run file; unit: that of the figures of `esail plot`; axis: what the components are,
    "tether", "rod", "xyz", "angle" or nothing; labels: one per component; values: (frame, component)."""

    symbol: str
    unit: str
    axis: str
    labels: tuple[str, ...]
    values: np.ndarray


@dataclasses.dataclass(frozen=True)
class Motion:
    """A run as a moving picture.

    title, model: what is shown, in words
    frames: indices of the saved instants that are shown; saved: number of all saved instants
    time: [s], (frame)
    vertices: positions [m], (frame, vertex, 3); NaN where a position is not known
    lines: indices of the vertices of every line
    markers: indices of the vertices that are drawn as dots, the remote units of a sail
    released: of every tether the first frame in which it is released, None of one that is held; empty of a
    chain. Frame, exaggeration and range of the colours follow the tethers that are held
    straight: unit vector of every vertex (vertex, 3), along which positions are never exaggerated
    rotation: C_B^I of a sail (frame, 3, 3); None of a chain, whose axes are the only ones
    wind: direction of the wind in inertial axes (frame, 3); None without wind
    basis: rows are the directions to the right, upwards and towards the viewer of the first view
    middle: position in the middle of the picture [m], (3); radius: half of the picture's width [m]
    yaw, pitch: first direction of view [rad], from that of the basis
    exaggeration: factor of the lateral positions at first
    period: spin period [s]; None without spin
    reach: length of the longest tether and radius of the hub [m]; None of a chain
    anchor: position of the hub, or of the fixed end of a chain [m], (3); None of a free chain
    shape: sentence on how the lines follow from the run file
    colours: quantities that may colour the lines, by name
    signals: observables that may be plotted, by name
    """

    title: str
    model: str
    frames: np.ndarray
    saved: int
    time: np.ndarray
    vertices: np.ndarray
    lines: tuple[tuple[int, ...], ...]
    markers: tuple[int, ...]
    released: tuple[int | None, ...]
    straight: np.ndarray
    rotation: np.ndarray | None
    wind: np.ndarray | None
    basis: np.ndarray
    middle: np.ndarray
    radius: float
    yaw: float
    pitch: float
    exaggeration: float
    period: float | None
    reach: float | None
    anchor: np.ndarray | None
    shape: str
    colours: Mapping[str, Quantity]
    signals: Mapping[str, Signal]

    @property
    def turning(self) -> bool:
        """Whether spinning axes exist beside the inertial ones."""
        return self.rotation is not None

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a viewer must know of the lines: how they follow from the run file, what the circle about a
        sail is, and how a released tether is drawn."""
        circle = () if self.reach is None else ("grey circle: undeformed tips in the spin plane",)
        numbers = [str(k + 1) for k, first in enumerate(self.released) if first is not None]
        tethers = f"tether{'s' * (len(numbers) > 1)} {', '.join(numbers)}"
        free = (f"{tethers}: grey when released, may leave the picture",) if numbers else ()
        return (self.shape, *circle, *free)


STEPS = (1.0, 2.0, 5.0)
"""First digits of an exaggeration that is chosen."""

LARGEST_SHARE = 0.3
"""Lateral positions are exaggerated to at most this part of the largest position along the lines."""

MOST_EXAGGERATED = 1000.0
"""Largest exaggeration that is chosen."""


def lateral(vertices: np.ndarray, straight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The parts of positions (..., vertex, 3) along the vectors `straight` (vertex, 3) and across
    them."""
    along = (vertices * straight).sum(-1, keepdims=True) * straight
    return along, vertices - along


def exaggerated(vertices: np.ndarray, straight: np.ndarray, factor: float) -> np.ndarray:
    """Positions (..., vertex, 3) whose parts across `straight` are multiplied by a factor."""
    along, across = lateral(vertices, straight)
    return along + factor * across


def chosen_exaggeration(vertices: np.ndarray, straight: np.ndarray) -> float:
    """The largest of 1, 2, 5, 10, 20, ... that keeps the lateral positions below LARGEST_SHARE of
    the largest position along the lines."""
    along, across = (np.linalg.norm(part, axis=-1) for part in lateral(vertices, straight))
    if not np.isfinite(across).any() or not np.nanmax(across) > 0.0:
        return 1.0
    room = LARGEST_SHARE * np.nanmax(along) / np.nanmax(across)
    steps = [digit * 10.0**power for power in range(4) for digit in STEPS]
    return max([step for step in steps if step <= min(room, MOST_EXAGGERATED)], default=1.0)
