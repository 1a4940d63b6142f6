"""Free flight of a stiff cable: uniform motion of its centre of mass, and rotation as a steadily stretched
bar.

With engineering strain, the radius from the middle is r(x) = sin(k x) / (k cos(k L/2)), k = Omega
sqrt(rho/EA). The cable is attached to a hub whose mass, 1e-9 of the cable's, has no effect.
"""

import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax.coordinates import Coordinates
from esail_jax.elements.rigid_body import RigidBody
from support.one_tether import STEPPERS, integrate, one_tether, straight

LENGTH, AXIAL, DENSITY, SPIN = 2.0, 4e3, 0.7, 1.3
DRIFT = np.array([0.05, -0.1, 0.2])
"""Velocity of the centre of mass [m/s]."""


@pytest.mark.nightly
@pytest.mark.parametrize("stepper", STEPPERS)
def test_free_flight(stepper, validate):
    """The paths of both ends, momentum and angular momentum are right over a turn of 400 steps."""
    radius = 1e-3
    hub = RigidBody(
        jnp.asarray(2e-3),
        jnp.asarray(radius),
        jnp.asarray(1e-9 * DENSITY * LENGTH / (np.pi * radius**2 * 2e-3)),
    )
    made = one_tether(
        elements=4, length=LENGTH, axial=AXIAL, bending=50.0, line_density=DENSITY,
        strain="engineering", radius=radius, hub=hub,
    )  # fmt: skip
    k = SPIN * np.sqrt(DENSITY / AXIAL)
    x = np.linspace(0.0, LENGTH, 5) - LENGTH / 2.0
    from_middle = np.sin(k * x) / (k * np.cos(k * LENGTH / 2.0))
    slope = np.cos(k * x) / np.cos(k * LENGTH / 2.0)
    q = straight(made, line=jnp.stack([from_middle - from_middle[0], slope])[:, :, None])
    middle = np.array([0.0, radius - from_middle[0], 0.0])
    # The cable spins about X through its middle, and drifts.
    omega = jnp.array([SPIN, 0.0, 0.0])
    arms = q.tether.at[0].add(-jnp.asarray(middle)[:, None, None])
    rates = jnp.cross(omega, arms, axisb=1, axisc=1).at[0].add(jnp.asarray(DRIFT)[:, None, None])
    v = Coordinates(rates, jnp.cross(omega, q.hub - middle) + DRIFT)
    steps = 400
    time, q, v, _ = integrate(stepper, made, q, v, 2.0 * np.pi / SPIN / steps, steps, 0.9)
    centre = middle + DRIFT * time[:, None]
    angle = SPIN * time
    direction = np.stack([0.0 * angle, np.cos(angle), np.sin(angle)], axis=1)
    case, reference = "free flight of a stiff cable", "rigid rotation, steady stretch"
    errors = []
    for node, arm in ((0, from_middle[0]), (-1, from_middle[-1])):
        errors.append(np.abs(q.tether[:, 0, :, node, 0] - centre - arm * direction).max())
    validate(
        f"FLY-1 {stepper}",
        case,
        reference,
        "path of the ends / L over a turn",
        max(errors) / LENGTH,
        (2.0 * np.pi / steps) ** 2,
    )
    inertia = [made.tethers.inertia(x) for x in (v.tether[0], v.tether[-1])]
    momentum = [x[0].sum((1, 2)) for x in inertia]
    error = np.abs(momentum[1] - momentum[0]).max() / np.linalg.norm(momentum[0])
    validate(f"FLY-2 {stepper}", case, "conservation", "momentum", error, 1e-8)
    turns = [
        np.cross(np.asarray(x), np.asarray(p), axis=1).sum((0, 2, 3))
        for x, p in zip((q.tether[0], q.tether[-1]), inertia, strict=True)
    ]
    error = np.abs(turns[1] - turns[0]).max() / np.linalg.norm(turns[0])
    validate(
        f"FLY-3 {stepper}", case, "conservation", "angular momentum", error, (2.0 * np.pi / steps) ** 2
    )
