"""The table [hub], a cylinder or a spacecraft with a mass and an inertia tensor: its checks, and the places
of its roots."""

from typing import Any

import numpy as np

from esail_jax.scenes import rules
from esail_jax.scenes.declarations import declare, table, vector
from esail_jax.scenes.rules import (
    Matrix,
    Number,
    SceneError,
    Shape,
    Vector,
    Vectors,
    any_number,
    positive,
)


@table
class Hub:
    """Rigid hub: a cylinder about X_B ([PGV] Table 1), by `height`, `radius` and `density`, or a spacecraft
    of any shape, by `mass` and `inertia`. Roots lie at `radius` from the axis, evenly in the plane through
    the hub centre, or where `roots` says."""

    height: Number | None = declare(positive, unit="m", doc="Height of the cylinder.", default=None)
    radius: Number | None = declare(
        positive, unit="m", doc="Radius of the cylinder, or of the circle of the roots.", default=None
    )
    density: Number | None = declare(positive, unit="kg/m^3", doc="Density of the cylinder.", default=None)
    mass: Number | None = declare(positive, unit="kg", doc="Mass of a spacecraft.", default=None)
    inertia: Matrix | None = declare(
        any_number,
        shape=Shape.MATRIX,
        unit="kg m^2",
        doc="Inertia tensor of a spacecraft about its centre of mass, in B.",
        default=None,
    )
    centre: Vector | None = vector(
        unit="m", doc="Centre of mass of a spacecraft from the hub centre, in B.", default=None
    )
    roots: Vectors | None = declare(
        any_number,
        shape=Shape.VECTORS,
        unit="m",
        doc="Positions of the roots on a spacecraft from the hub centre, in B, in place of `radius`.",
        default=None,
    )
    torque: Vector | None = vector(
        unit="N m", doc="Constant torque on the hub, in B: a disturbance.", default=None
    )


CYLINDER = ("height", "radius", "density")
"""Keys of a cylinder."""


SPACECRAFT = ("mass", "inertia", "centre", "roots")
"""Keys of a spacecraft; it may also have the radius of the circle of its roots."""


SYMMETRY = 1e-12
"""Largest difference of two entries of a tensor that count as equal, as a fraction of its trace."""


def check_hub(scene: Any) -> None:
    """Checks that a hub is a cylinder or a spacecraft, with all its keys, and that the scene can have its
    roots. Raises SceneError."""
    hub = scene.hub
    check_shape(hub)
    if hub.roots is not None and scene.auxiliary_tethers is not None:
        raise SceneError("hub.roots", "be left out with [auxiliary_tethers]", "is given")
    if hub.roots is not None and scene.initial.elongation == "paper":
        raise SceneError("hub.roots", 'be left out with `initial.elongation` = "paper"', "is given")


def check_shape(hub: Hub) -> None:
    """Checks that a hub is a cylinder or a spacecraft, with all its keys. Raises SceneError."""
    given = [name for name in SPACECRAFT if getattr(hub, name) is not None]
    if not given:
        for name in CYLINDER:
            if getattr(hub, name) is None:
                raise SceneError(f"hub.{name}", "be given", "is missing")
        return
    for name in ("height", "density"):
        if getattr(hub, name) is not None:
            raise SceneError(f"hub.{name}", f"be left out with `hub.{given[0]}`", "is given")
    for name in ("mass", "inertia"):
        if getattr(hub, name) is None:
            raise SceneError(f"hub.{name}", f"be given with `hub.{given[0]}`", "is missing")
    if (hub.radius is None) == (hub.roots is None):
        got = "neither is" if hub.radius is None else "both are"
        raise SceneError("hub.roots", "be given, or `hub.radius`", got)
    check_inertia(hub.inertia)


def root_positions(hub: Hub | None, count: int) -> np.ndarray:
    """The positions of the roots in B [m], (3, tether): those of `roots`, or at `radius` from the axis at
    even azimuths; zero without a hub. All numbers of the hub must have a value."""
    if hub is not None and hub.roots is not None:
        return np.broadcast_to(np.asarray(hub.roots, float), (count, 3)).T
    azimuth = 2.0 * np.pi * np.arange(count) / count
    radius = 0.0 if hub is None else float(np.asarray(hub.radius))
    return radius * np.stack([0.0 * azimuth, np.cos(azimuth), np.sin(azimuth)])


def inertia_of(hub: Hub) -> np.ndarray:
    """The inertia tensor [kg m^2] about the centre of mass in B. All numbers of the hub must have a
    value."""
    if hub.inertia is not None:
        return np.asarray(hub.inertia, float)
    height, radius, density = (float(getattr(hub, name)) for name in CYLINDER)
    mass = density * np.pi * radius**2 * height
    across = mass * (3.0 * radius**2 + height**2) / 12.0
    return np.diag([0.5 * mass * radius**2, across, across])


def azimuths(hub: Hub | None, count: int) -> np.ndarray:
    """The azimuths of the roots about X_B [rad], (tether); that of a root on the axis is even."""
    even = 2.0 * np.pi * np.arange(count) / count
    if hub is None or hub.roots is None:
        return even
    _, y, z = root_positions(hub, count)
    return np.where((y == 0.0) & (z == 0.0), even, np.arctan2(z, y))


def check_inertia(inertia: object) -> None:
    """Checks that a tensor is that of a body with an extent in three directions: symmetric, and every
    principal moment less than the sum of the two others. Raises SceneError."""
    known = rules.known(inertia)
    if known is None:
        return
    trace = np.abs(np.diag(known)).sum()
    if np.abs(known - known.T).max() > SYMMETRY * trace:
        raise SceneError("hub.inertia", "be symmetric", rules.describe(inertia))
    moments = np.linalg.eigvalsh(known)
    if moments[2] >= moments[0] + moments[1]:
        must = "have principal moments of which each is less than the sum of the two others"
        raise SceneError("hub.inertia", must, f"has {', '.join(f'{x:.4g}' for x in moments)}")
