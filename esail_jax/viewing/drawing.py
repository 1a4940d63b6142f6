"""One moment of a run as a matplotlib figure: the frames of an animation."""

import dataclasses
import textwrap

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure

from esail_jax.viewing.camera import Camera
from esail_jax.viewing.colour_scale import STOPS, colours_of, locked_range
from esail_jax.viewing.motion import Motion, exaggerated

INK, SOFT, FAINT, WIND = "#1b1f24", "#5a6270", "#c9ced6", "#b45309"
"""Colours of text, of remarks, of what does not deform, and of the wind."""

ARROW = 0.62
"""Length of the arrow of the wind, as a part of the picture's radius."""

DOTS_PER_INCH = 100
"""Resolution of the figure."""

PIXELS_PER_LETTER = 5.0
"""Mean width of a letter of a remark, at 7 points."""

LOW_STRIP = 0.13
"""Part of the height below the picture for the key of the colours."""

CIRCLE = np.linspace(0.0, 2.0 * np.pi, 97)
"""Angles of the polygon that stands for a circle [rad]."""


@dataclasses.dataclass(frozen=True)
class Style:
    """How a run is drawn.

    exaggeration: factor of the lateral positions; axes: "inertial" or "spinning"; colour: name of the
    quantity that colours the lines, None for none; width, height: [pixel]"""

    exaggeration: float
    axes: str
    colour: str | None
    width: int
    height: int


class Drawing:
    """A figure whose lines are moved from instant to instant.

    motion: the run; style: how it is drawn"""

    def __init__(self, motion: Motion, style: Style):
        self.motion, self.style = motion, style
        size = (style.width / DOTS_PER_INCH, style.height / DOTS_PER_INCH)
        self.figure = Figure(figsize=size, dpi=DOTS_PER_INCH, facecolor="white")
        self.canvas = FigureCanvasAgg(self.figure)
        ax = self.figure.add_axes((0.0, LOW_STRIP, 1.0, 1.0 - LOW_STRIP))
        ax.set_axis_off()
        top = style.height * (1.0 - LOW_STRIP)
        ax.set(xlim=(0.0, style.width), ylim=(top, 0.0))
        self.camera = Camera(motion.yaw, motion.pitch, motion.radius, float(style.width), top)
        self.shapes = exaggerated(motion.vertices, motion.straight, style.exaggeration) - motion.middle
        self.quantity = motion.colours.get(style.colour)
        self.range = locked_range(self.quantity.values) if self.quantity else (0.0, 0.0)
        self.reference = LineCollection([], colors=FAINT, linewidths=0.8)
        self.lines = LineCollection([], capstyle="round", joinstyle="round")
        ax.add_collection(self.reference)
        ax.add_collection(self.lines)
        self.dots = ax.scatter([], [], zorder=3)
        self.anchor = ax.plot([], [], "s", color=INK, markersize=5, zorder=4)[0]
        self.wind = ax.annotate(
            "", (0, 0), (0, 0), arrowprops={"arrowstyle": "->", "color": WIND, "lw": 1.4}, zorder=4
        )
        self.wind.set_visible(motion.wind is not None)
        self.wind_name = ax.text(0.0, 0.0, "solar wind", color=WIND, fontsize=8, va="top")
        self.wind_name.set_visible(motion.wind is not None)
        self.figure.text(0.015, 0.985, statement(motion, style), color=INK, fontsize=9, va="top")
        lines = textwrap.fill("; ".join(motion.remarks), int(style.width / PIXELS_PER_LETTER))
        self.figure.text(0.015, 0.01, lines, color=SOFT, fontsize=7, va="bottom")
        self.clock = self.figure.text(0.985, 0.985, "", color=INK, fontsize=9, va="top", ha="right")
        if self.quantity:
            self.add_key()

    def add_key(self) -> None:
        """Adds the key of the colours."""
        low, high = self.range
        values = colours_of(np.linspace(low, high, 256), low, high) / 255.0
        scale = LinearSegmentedColormap.from_list("lines", STOPS if high > low else [values[0], values[0]])
        unit = "" if self.quantity.unit == "-" else f" [{self.quantity.unit}]"
        bar = self.figure.colorbar(
            ScalarMappable(Normalize(low, high if high > low else low + 1.0), scale),
            cax=self.figure.add_axes((0.3, 0.125, 0.4, 0.02)),
            orientation="horizontal",
            ticks=np.linspace(low, high, 3) if high > low else [],
            format=lambda x, _: plain(x),
        )
        value = "" if high > low else f" = {plain(low)}"
        bar.set_label(self.quantity.label + value + unit, fontsize=8, color=INK, labelpad=2)
        bar.ax.tick_params(labelsize=7, color=SOFT, labelcolor=SOFT, length=2, pad=1)
        bar.outline.set_visible(False)

    def orientations(self, frame: int) -> tuple[np.ndarray, np.ndarray]:
        """The rotations (3, 3) from the axes of the vertices, and from inertial axes, to those of
        the camera."""
        camera = self.camera.turn() @ self.motion.basis
        if self.motion.rotation is None:
            return camera, camera
        now = self.motion.rotation[frame]
        body = camera @ (now if self.style.axes == "inertial" else self.motion.rotation[0])
        return body, body @ now.T

    def image(self, frame: int) -> np.ndarray:
        """The picture at one instant, (height, width, 3) of 0 to 255."""
        motion = self.motion
        body, inertial = self.orientations(frame)
        if motion.reach is not None:
            circle = np.stack([0.0 * CIRCLE, np.cos(CIRCLE), np.sin(CIRCLE)], axis=1)
            axis = np.array([[-0.35, 0.0, 0.0], [0.35, 0.0, 0.0]])
            parts = [motion.reach * part for part in (circle, axis)]
            self.reference.set_segments([self.camera.project(part @ body.T) for part in parts])
        points = self.shapes[frame] @ body.T
        pixels = self.camera.project(points)
        size = self.camera.enlargement(points)
        ends = np.array([line[-1] for line in motion.lines])
        order = np.argsort(np.nan_to_num(size[ends]))
        colours = self.colours(frame)
        self.lines.set_segments([pixels[list(motion.lines[k])] for k in order])
        self.lines.set_color(colours[order])
        self.lines.set_linewidth(1.7 * np.nan_to_num(size[ends][order], nan=1.0) ** 2)
        markers = list(motion.markers)
        self.dots.set_offsets(pixels[markers])
        self.dots.set_sizes(16.0 * np.nan_to_num(size[markers], nan=1.0) ** 2)
        of_lines = len(markers) <= len(ends) and (ends[: len(markers)] == markers).all()
        self.dots.set_color(colours[: len(markers)] if of_lines else INK)
        if motion.anchor is not None:
            (place,) = self.camera.project((motion.anchor - motion.middle)[None] @ body.T)
            self.anchor.set_data(place[:1], place[1:])
        if motion.wind is not None:
            self.move_wind(ARROW * motion.radius * inertial @ motion.wind[frame])
        self.clock.set_text(moment(motion, frame))
        self.canvas.draw()
        return np.asarray(self.canvas.buffer_rgba())[..., :3].copy()

    def colours(self, frame: int) -> np.ndarray:
        """The colours of all lines (line, 3), each 0 to 1."""
        values = self.quantity.values[frame] if self.quantity else np.full(len(self.motion.lines), np.nan)
        return colours_of(values, *self.range) / 255.0

    def move_wind(self, tip: np.ndarray) -> None:
        """Moves the arrow of the wind to end at a point in camera axes [m]."""
        start, end = self.camera.project(np.stack([np.zeros(3), tip]))
        self.wind.xy, self.wind.xyann = end, start
        self.wind.set_position(start)
        self.wind_name.set_position(end + np.array([0.0, 6.0]))
        self.wind_name.set_horizontalalignment("left" if end[0] < start[0] else "right")


def statement(motion: Motion, style: Style) -> str:
    """What is drawn, in words: the exaggeration and the axes."""
    shape = "true shape"
    if style.exaggeration != 1.0:
        shape = f"lateral displacements × {style.exaggeration:g}"
    return f"{shape}, {style.axes} axes, centred on the hub" if motion.turning else shape


def plain(number: float) -> str:
    """A number with four digits, without an exponent from 0.001 to a million, as the page writes it."""
    size = abs(number)
    if size != 0.0 and not 1e-3 <= size < 1e6:
        return f"{number:.3e}"
    return np.format_float_positional(float(f"{number:.4g}"), trim="-")


def moment(motion: Motion, frame: int) -> str:
    """The time of an instant in words, with the number of spin periods."""
    time = motion.time[frame]
    turns = "" if motion.period is None else f"\n{time / motion.period:.2f} spin periods"
    return f"t = {plain(time)} s" + turns
