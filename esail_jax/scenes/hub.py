"""The hub, a cylinder or a spacecraft with a mass and an inertia tensor: its checks, and the places of its
roots."""

import numpy as np

from esail_jax.scenes import rules
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.sail_tables import Hub

CYLINDER = ("height", "radius", "density")
"""Keys of a cylinder."""

SPACECRAFT = ("mass", "inertia", "centre", "roots")
"""Keys of a spacecraft; it may also have the radius of the circle of its roots."""

SYMMETRY = 1e-12
"""Largest difference of two entries of a tensor that count as equal, as a fraction of its trace."""


def check_hub(hub: Hub) -> None:
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
        found = "neither is" if hub.radius is None else "both are"
        raise SceneError("hub.roots", "be given, or `hub.radius`", found)
    check_inertia(hub.inertia)


def root_positions(hub: Hub | None, count: int) -> np.ndarray:
    """The positions of the roots in B [m], (3, tether): those of `roots`, or at `radius` from the axis at
    even azimuths; zero without a hub. All numbers of the hub must have a value."""
    if hub is not None and hub.roots is not None:
        return np.broadcast_to(np.asarray(hub.roots, float), (count, 3)).T
    azimuth = 2.0 * np.pi * np.arange(count) / count
    radius = 0.0 if hub is None else float(hub.radius)
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
