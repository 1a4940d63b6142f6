"""Checks of the arguments of a run, which are the same for `simulate`, `run` and ensembles."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from esail_jax.errors import nearest
from esail_jax.observables import described, known_names
from esail_jax.observables.entry import WORK, in_words
from esail_jax.scenes.rules import SceneError, has_traced, is_traced, known, numbers_of
from esail_jax.scenes.scene import Scene
from esail_jax.simulation.rectification import AnyPoint, PointOnOrbit
from esail_jax.steppers.stepper import Point


def check_arguments(
    scene: Scene,
    save: Sequence[str] | None,
    times: Sequence[float] | None,
    start: AnyPoint | None,
    max_steps: int | None,
) -> None:
    """Raises SceneError unless these arguments of `simulate` suit each other and the scene."""
    check_start(scene, start)
    check_times(scene, times, start)
    check_names(scene, save)
    check_max_steps(max_steps)


def check_start(scene: Scene, start: AnyPoint | None) -> None:
    """Raises SceneError if the start of a run is no point, one on an orbit where there is no orbit, or one
    of another number of tethers, rods or elements."""
    if not isinstance(start, Point | PointOnOrbit | None):
        raise SceneError(
            "start", "be a point, such as `solution.final_state`", f"is of type {type(start).__name__}"
        )
    if start is None:
        return
    if isinstance(start, PointOnOrbit) and (scene.chain is not None or scene.orbit is None):
        raise SceneError("start", "have no orbit in a scene without [orbit] and a sail", "has one")
    for name, expected in shapes_of(scene).items():
        for part in ("q", "v"):
            value = getattr(getattr(start, part), name)
            shape = None if value is None else np.shape(value)
            if shape != expected:
                raise SceneError(f"start.{part}.{name}", f"have the shape {expected}", f"has {shape}")


def shapes_of(scene: Scene) -> dict[str, tuple[int, ...] | None]:
    """The shapes of the parts of a scene's coordinates, None for a part that it does not have."""
    if scene.chain is not None:
        return {"tether": (1, 3, scene.chain.rods + 1, 1), "hub": None, "ring": None}
    tethers, ring = scene.tethers, scene.auxiliary_tethers
    coefs = {"truss": 1, "cable": 2}
    vectors = 0 if ring is None else coefs[ring.element] * (ring.elements + 1) - 2
    return {
        "tether": (coefs[tethers.element], 3, tethers.elements + 1, tethers.count),
        "hub": None if scene.hub is None else (4, 3),
        "ring": (3, vectors, tethers.count) if vectors else None,
    }


def known_time(start: AnyPoint) -> float | None:
    """The time of a start [s], None if it is traced: it has no value until the program runs."""
    return None if is_traced(start.time) else float(start.time)


def check_times(scene: Scene, times: Any, start: AnyPoint | None) -> None:
    """Raises SceneError unless the saved instants are concrete numbers that increase, do not precede the
    start, and lie where the wind of the scene is known."""
    begin = 0.0 if start is None else known_time(start)
    if times is None:
        if begin is not None and begin > scene.integrator.t_end:
            must = f"not be later than `integrator.t_end` ({scene.integrator.t_end:g})"
            raise SceneError("start.time", must, f"is {begin:g}")
        return
    if is_traced(times) or has_traced(times):
        got = "is traced (`start._replace(time=0.0)` lets a run begin at a plain time)"
        raise SceneError("times", "be plain numbers", got)
    values = numbers_of("times", times)
    good = (
        values is not None and values.ndim == 1 and len(values)
        and np.isfinite(values).all() and (np.diff(values) > 0).all()
    )  # fmt: skip
    least = 0.0 if begin is None else begin
    if values is None or not good or values[0] < least:
        raise SceneError("times", f"increase from {least:g} on", f"is {times!r}")
    table = scene.solar_wind if scene.chain is None else None
    wind = None if table is None or table.time is None else known(table.time)
    if wind is not None and values[-1] > wind[-1]:
        raise SceneError("times", f"not go beyond `solar_wind.time` ({wind[-1]:g})", f"has {values[-1]:g}")


def check_names(scene: Scene, save: Sequence[str] | None) -> None:
    """Raises SceneError if a name is not that of an observable, or of one whose part the scene lacks."""
    for name in save or ():
        names = known_names(scene.chain is not None)
        if name not in names:
            raise SceneError("save", f"hold names of observables{nearest(name, names)}", f"has {name!r}")
        need = described(name, scene.chain is not None).needs
        if need not in ("", WORK) and not scene.has(need):
            raise SceneError("save", f"hold no {name!r} without {in_words(need)}", "does")
        if scene.deployment is not None and name.startswith(("flat_sail", "axisymmetric")):
            must = f"hold no {name!r} with [deployment]: it is that of tethers of constant length"
            raise SceneError("save", must, "does")


def check_max_steps(max_steps: int | None) -> None:
    """Raises SceneError unless the bound is None or a positive integer."""
    if max_steps is not None and not (isinstance(max_steps, int | np.integer) and max_steps > 0):
        raise SceneError("max_steps", "be a positive whole number", f"is {max_steps!r}")
