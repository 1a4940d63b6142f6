"""One page for a browser that shows runs in motion, complete in itself: it opens without a network.

The page is `web/page.html` with the style, the scripts and the data of the runs put into it. Its
Content-Security-Policy allows this script and this style by their checksums, and nothing else: no request
can leave the page."""

import base64
import hashlib
import html
import json
from collections.abc import Mapping, Sequence
from importlib import metadata, resources
from typing import Any

import numpy as np

from esail_jax.viewing.colour_scale import EQUAL, NONE, STOPS
from esail_jax.viewing.motion import Motion, Quantity, Signal

SCRIPTS = ("pure.js", "picture.js", "plot.js", "page.js")
"""Scripts of the page, in the order of their dependence."""

MOST_INSTANTS = 1200
"""Largest number of saved instants of a run on a page. It keeps the page of a sail of twelve tethers below
3 MB."""

FIRST_PLOTS = (("coning_angle", "lagging_angle"), ("tension", "kinetic_energy"))
"""Observables that are plotted first, of a sail and of a chain."""

FOOTER = "Drag to turn, wheel to zoom, double click for the first view. Written by esail_jax {version}."


def page_of(
    motions: Sequence[Motion],
    *,
    exaggeration: float | None = None,
    axes: str = "inertial",
    colour: str | None = None,
) -> str:
    """The HTML text of a page that shows runs side by side.

    exaggeration: factor of the lateral positions at first, None to choose it; axes: "inertial" or
    "spinning"; colour: name of the quantity that colours the lines, None for the first one."""
    first = motions[0]
    factor = min(motion.exaggeration for motion in motions) if exaggeration is None else exaggeration
    start = {
        "axes": axes,
        "colour": next(iter(first.colours), "none") if colour is None else colour,
        "exaggeration": factor,
        "yaw": float(first.yaw),
        "pitch": float(first.pitch),
    }
    data = {
        "runs": [run_of(motion) for motion in motions],
        "start": start,
        "plots": FIRST_PLOTS[0] if first.turning else FIRST_PLOTS[1],
        "stops": STOPS,
        "none": NONE,
        "equal": EQUAL,
    }
    style = part("page.css")
    script = "\n".join(part(name) for name in SCRIPTS)
    contents = {
        "TITLE": html.escape(", ".join(motion.title for motion in motions)),
        "STYLE_HASH": checksum(style),
        "SCRIPT_HASH": checksum(script),
        "STYLE": style,
        "FOOTER": html.escape(FOOTER.format(version=metadata.version("esail_jax"))),
        "DATA": json.dumps(data).replace("<", "\\u003c"),
        "SCRIPT": script,
    }
    pieces = part("page.html").split("@")
    return "".join(contents.get(piece, piece) for piece in pieces)


def part(name: str) -> str:
    """A file of the page."""
    return (resources.files("esail_jax.viewing") / "web" / name).read_text(encoding="utf-8")


def checksum(text: str) -> str:
    """The source expression of a text in a Content-Security-Policy."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def packed(values: Any) -> dict[str, Any] | None:
    """An array as base64 of little-endian float32, by rows, with its shape; None for None."""
    if values is None:
        return None
    array = np.asarray(values, "<f4")
    return {"data": base64.b64encode(array.tobytes()).decode(), "shape": array.shape}


def run_of(motion: Motion) -> dict[str, Any]:
    """The data of a run, as `web/picture.js` reads them."""
    arrays = ("time", "frames", "vertices", "straight", "rotation", "wind")
    return {name: packed(getattr(motion, name)) for name in arrays} | {
        "title": motion.title,
        "model": motion.model,
        "saved": motion.saved,
        "lines": motion.lines,
        "markers": motion.markers,
        "released": motion.released,
        "basis": motion.basis.ravel().tolist(),
        "middle": motion.middle.tolist(),
        "radius": motion.radius,
        "reach": motion.reach,
        "anchor": None if motion.anchor is None else motion.anchor.tolist(),
        "period": motion.period,
        "remarks": motion.remarks,
        "colours": series(motion.colours),
        "signals": series(motion.signals),
    }


def series(entries: Mapping[str, Quantity | Signal]) -> dict[str, Any]:
    """Quantities or signals by name, with their values packed."""
    return {name: vars(entry) | {"values": packed(entry.values)} for name, entry in entries.items()}
