"""Runs in motion, from Python: the page of `esail view` and the animation of `esail animate`."""

import html
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from esail_jax.atomic_file import atomic_file
from esail_jax.files.opening import ArgumentError
from esail_jax.viewing.motion import Motion
from esail_jax.viewing.motions import read_motions
from esail_jax.viewing.page import MOST_INSTANTS, page_of

AXES = ("inertial", "spinning")
"""Axes of a sail: inertial, or those of the hub."""

PAGES = (".html", ".htm")
"""Endings of the files that `view` writes."""

MOVIES = (".webp", ".gif", ".mp4")
"""Endings of the files that `animate` writes."""

SIDES = range(64, 4097)
"""Widths and heights [pixel] that `animate` draws."""

LONGEST = 600.0
"""Longest duration of a picture [s]: a GIF has 16 bits for hundredths of a second."""

FRAME_HEIGHT = 720
"""Height of a page in a notebook [pixel]."""


class Page(NamedTuple):
    """A page for a browser, as its text, which a notebook shows."""

    text: str

    def _repr_html_(self) -> str:
        """The page in a frame of its own, in which it opens as in a window of the browser."""
        inside = html.escape(self.text)
        return (
            f'<iframe sandbox="allow-scripts" srcdoc="{inside}" width="100%" height="{FRAME_HEIGHT}" '
            'style="border: 0"></iframe>'
        )

    def __repr__(self) -> str:
        return f"Page of {len(self.text) / 1e6:.2g} MB (shown by a notebook; `view(run, path)` writes it)"


def view(
    runs: Any,
    path: str | os.PathLike | None = None,
    *,
    member: int | Sequence[int] | None = None,
    exaggeration: float | None = None,
    axes: str | None = None,
    colour: str | None = None,
    overwrite: bool = False,
) -> Page:
    """A page for a browser that shows runs in motion, side by side; it needs no network.

    runs: a solution, an ensemble, the path of a file, or a list of them; path: a file .html that is written
    as well; member: numbers of the members of an ensemble, from 0; exaggeration: factor of the lateral
    displacements, None to choose it so that the motion is visible; axes: of a sail, "inertial" (None) or
    "spinning"; colour: what colours tethers or rods, "tension" (None), "voltage", "strain" or "none";
    overwrite: whether a file that exists is replaced. A run must have the positions that the page draws:
    those of the tips and the attitude are among the observables, all nodes with
    `save=["node_position_I", ...]`.

        esail.view(run)                 # in a notebook
        esail.view(run, "sail.html")

    Raises FileExistsError for a path that exists, ArgumentError for an argument that does not suit the
    runs, and RunFileError for runs that lack what is drawn."""
    if path is not None:
        path = checked_path(Path(path), PAGES, overwrite)
    motions = motions_of(runs, member, MOST_INSTANTS, exaggeration, axes, colour)
    page = Page(page_of(motions, exaggeration=exaggeration, axes=axes or AXES[0], colour=colour))
    if path is not None:
        with atomic_file(path) as part:
            part.write_text(page.text, encoding="utf-8")
    return page


def animate(
    run: Any,
    path: str | os.PathLike,
    *,
    seconds: float = 6.0,
    fps: float = 15.0,
    size: Sequence[int] | str = (560, 480),
    member: int | Sequence[int] | None = None,
    exaggeration: float | None = None,
    axes: str | None = None,
    colour: str | None = None,
    overwrite: bool = False,
) -> Path:
    """Writes a run as a moving picture and returns the path.

    run: a solution, an ensemble (with one member), or the path of a file; path: a file .webp, .gif or .mp4
    (needs imageio-ffmpeg); seconds: duration of the whole run; fps: pictures per second, at most; size:
    width and height [pixel], each 64 to 4096 (even ones for .mp4), or a text such as "560x480"; the others
    are those of `view`.

        esail.animate(run, "sail.webp", seconds=10.0, exaggeration=20.0)

    Raises FileExistsError for a path that exists, ArgumentError for an argument that does not suit the run,
    and RunFileError for a run that lacks what is drawn."""
    path = checked_path(Path(path), MOVIES, overwrite)
    for name, value in (("seconds", seconds), ("fps", fps)):
        check_positive(name, value)
    width, height = sides_of(size)
    from esail_jax.viewing.animation import check_movie, write_animation
    from esail_jax.viewing.drawing import Style

    suffix = path.suffix.lower()
    if suffix == MOVIES[-1]:
        if width % 2 or height % 2:
            raise ArgumentError("size", "be even in a .mp4 file", f"is {width}x{height}")
        check_movie()
    most = max(1, round(min(fps * seconds, 1e9)))
    motions = motions_of(run, member, most, exaggeration, axes, colour)
    if len(motions) > 1:
        key = "run" if isinstance(run, list | tuple) else "member"
        raise ArgumentError(key, "be given once", f"is {len(motions)} times")
    motion = motions[0]
    longest = LONGEST * len(motion.time)
    if seconds > longest:
        must = f"be {longest:g} at most for {len(motion.time)} pictures"
        raise ArgumentError("seconds", must, f"is {seconds:g}")
    factor = motion.exaggeration if exaggeration is None else exaggeration
    shade = colour or next(iter(motion.colours), "none")
    style = Style(factor, axes or AXES[0], shade, width, height)
    with atomic_file(path) as part:
        write_animation(motion, style, part, len(motion.time) / seconds, suffix)
    return path


def checked_path(path: Path, suffixes: tuple[str, ...], overwrite: bool) -> Path:
    """A path with one of the suffixes. Raises ArgumentError for another one, and FileExistsError if it
    exists."""
    if path.suffix.lower() not in suffixes:
        *most, last = suffixes
        must = f"end in {', '.join(most)} or {last}"
        raise ArgumentError("path", must, f"ends in {path.suffix.lower()!r}")
    if path.exists() and not overwrite:
        raise FileExistsError(f"`{path}` must not exist (or pass overwrite=True), but does")
    return path


def check_positive(name: str, value: float | None) -> None:
    """Raises ArgumentError for a number that is given but not positive and finite."""
    if value is not None and not 0.0 < value < math.inf:
        raise ArgumentError(name, "be positive and finite", f"is {value:g}")


def sides_of(size: Sequence[int] | str) -> tuple[int, int]:
    """Width and height [pixel] of a pair of them or of a text. Raises ArgumentError."""
    pair = size.lower().split("x") if isinstance(size, str) else list(size)
    sides = [int(side) if str(side).isdecimal() else 0 for side in pair]
    if len(sides) != 2 or not all(side in SIDES for side in sides):
        must = f"be width and height in pixels, each {SIDES[0]} to {SIDES[-1]}"
        raise ArgumentError("size", must, f"is {size!r}")
    return sides[0], sides[1]


def motions_of(
    runs: Any,
    member: int | Sequence[int] | None,
    most: int,
    exaggeration: float | None,
    axes: str | None,
    colour: str | None,
) -> list[Motion]:
    """The moving pictures of runs. most: largest number of saved instants in one picture. Raises
    ArgumentError for a colour or axes that they do not have, and RunFileError."""
    check_positive("exaggeration", exaggeration)
    if axes not in (None, *AXES):
        raise ArgumentError("axes", f"be {' or '.join(AXES)}", f"is {axes!r}")
    several = runs if isinstance(runs, list | tuple) else [runs]
    if not several:
        raise ArgumentError("runs", "have one run or more", "has none")
    numbers = () if member is None else tuple(np.atleast_1d(member).tolist())
    motions = read_motions(several, numbers, most)
    if len({motion.turning for motion in motions}) > 1:
        raise ArgumentError("runs", "be of sails or of chains", "there are both")
    known = [*dict.fromkeys(name for motion in motions for name in motion.colours), "none"]
    if colour is not None and colour not in known:
        raise ArgumentError("colour", f"be one of {', '.join(known)} here", f"is {colour!r}")
    if axes is not None and not motions[0].turning:
        raise ArgumentError("axes", "be left out with a chain", f"is {axes!r}")
    return motions
