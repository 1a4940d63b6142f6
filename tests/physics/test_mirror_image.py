"""The mirror image of a sail moves as the mirror image of its motion.

The mirror is the plane of X_O and Z_O, in which the wind blows and X_B lies at the start. The image spins
the other way round, and tether i is the image of tether p/2 - i: it has that one's numbers. Every law,
load and observable keeps its meaning: phases and lagging angles are counted in the sense of the spin, and
feedback steers to the same side. A sign that belongs to one sense of the spin only shows here at once.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.commands.running import names_with
from esail_jax.design.objectives import NAMES, values
from esail_jax.measurements import Measurements
from support.laws_and_loads import CASES, SAIL, P

IMAGE = (P // 2 - np.arange(P)) % P
"""The image of every tether."""

POLAR, AXIAL = np.array([1.0, -1.0, 1.0]), np.array([-1.0, 1.0, -1.0])
"""Factors of the components of a vector, such as a force, and of an axial one, such as a moment. They are
the same in O, and in B, whose axis Y_B is opposite to the image of Y_B."""

SIGNS = {
    "angular_velocity_B": AXIAL, "euler_hub": np.array([-1.0, 1.0, -1.0]),
    "precession_angle": -1.0, "rotation_IB": np.outer(POLAR, POLAR), "thrust_O": POLAR, "reaction_O": POLAR,
    "thrust_B": POLAR, "reaction_B": POLAR, "thrust_moment_O": AXIAL, "reaction_moment_O": AXIAL,
    "thrust_moment_B": AXIAL, "spin_rate": -1.0, "angular_momentum_I": -1.0,
    "total_angular_momentum_I": -1.0, "hub_acceleration_B": POLAR, "tip_direction_B": POLAR,
}  # fmt: skip
"""What becomes of an observable; the others stay the same, positions in I aside."""

UNRELATED = {"euler_sail", "energy_balance_error"}
"""The third angle of the first is that of tip 1; the second is rounding, and an error of the steps."""


def image_of(scene: dict[str, Any]) -> dict[str, Any]:
    """The keys of the mirror image."""
    found = dict(scene) | {"initial.spin_rate": -scene.get("initial.spin_rate", 4e-3)}
    for key, x in scene.items():
        if np.ndim(x) and np.shape(x)[-1] == P and key != "voltage.time":
            found[key] = np.asarray(x)[..., IMAGE].tolist()
    if scene.get("tip_thrust.direction") == "tangential":  # along X_B x d, which is no vector
        found["tip_thrust.force"] = (-np.asarray(found["tip_thrust.force"])).tolist()
    if "hub.torque" in scene:
        found["hub.torque"] = AXIAL * scene["hub.torque"]
    if "hub.roots" in scene:
        found["hub.inertia"] = np.outer(POLAR, POLAR) * scene["hub.inertia"]
        found["hub.centre"] = POLAR * scene["hub.centre"]
        found["hub.roots"] = (POLAR * scene["hub.roots"])[IMAGE]
    if "event.release" in scene:
        found["event.release"] = [int(IMAGE[i - 1]) + 1 for i in scene["event.release"]]
    return found


def reflected(name: str, rows: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """An observable of the image."""
    axes = esail.observables.described(name).axes
    if name.endswith("_I") and name != "rotation_IB":
        rows = rows - 2.0 * (rows @ origin)[..., None] * origin
    rows = rows * SIGNS.get(name, 1.0)
    return rows[:, IMAGE] if "tether" in axes else rows


DEFAULT = ("harmonic", "feedback")

AROUND = 2.0 * np.pi * np.arange(P) / P + 0.1 * np.sin(1.0 + np.arange(P))
SPACECRAFT = {
    "hub.height": None, "hub.radius": None, "hub.density": None, "hub.mass": 200.0,
    "hub.inertia": np.array([[300.0, 10.0, 20.0], [10.0, 200.0, -15.0], [20.0, -15.0, 250.0]]),
    "hub.centre": np.array([0.05, -0.1, 0.02]), "integrator.tolerance": 1e-9,
    "hub.roots": np.stack([0.1 * np.cos(3.0 * AROUND), np.cos(AROUND), np.sin(AROUND)], axis=1),
    "hub.torque": np.array([2e-3, -3e-3, 4e-3]),
}  # fmt: skip
"""A hub without symmetry, with a torque. Its base points, by which errors are estimated, are not those of
its image."""

CASES = CASES | {"spacecraft": SPACECRAFT}


@pytest.mark.parametrize(
    "case", [x if x in DEFAULT else pytest.param(x, marks=pytest.mark.nightly) for x in CASES]
)
def test_the_image_moves_as_the_image_of_the_motion(case):
    """All observables, to 1e-5 of their largest entry. Rounding is not that of an image, and the power of
    damping, which follows from small differences of velocities, differs by 6e-7; a wrong sign changes some
    observable by 1e-3 or more."""
    scene = SAIL | CASES[case]
    # The instruments on the hub are observables on request.
    requested = ("hub_acceleration_B", "tip_direction_B") if case == "spacecraft" else ()
    names = names_with(esail.load_scene("baseline", scene), requested)
    run, image = (esail.simulate("baseline", x, save=names) for x in (scene, image_of(scene)))
    if case != "spacecraft":
        assert (
            abs(image.steps - run.steps) <= P
        )  # rounding may divide the time to a tether's knot once more
    orbital = run["rotation_IB"][0]  # Y_B is Y_O at the start
    for name in run:
        if name in UNRELATED:
            continue
        expected = reflected(name, run[name], orbital[:, 1])
        if name == "rotation_IB":
            mirror = np.eye(3) - 2.0 * np.outer(orbital[:, 1], orbital[:, 1])
            expected = np.einsum("ij,tjk,kl->til", mirror, run[name], np.diag(POLAR))
        size = np.nanmax(np.abs(expected), initial=1e-300)
        np.testing.assert_allclose(image[name], expected, rtol=0, atol=1e-5 * size, err_msg=name)
    # A precession angle is that of the image with the other sign; the other objectives are the same. Those
    # that are differences of unit vectors have the rounding of these, 1e-12.
    limits = ("tension:5", "tension:0,1e-3")
    aims = [
        (*NAMES, *limits, f"spin-plane:13,{angle}", f"spin-plane:13,{angle},200") for angle in (20, -20)
    ]
    of_run, of_image = ([*values(x, aim).values()] for x, aim in zip((run, image), aims, strict=True))
    np.testing.assert_allclose(of_image, of_run, rtol=1e-4, atol=1e-12)


def test_the_sense_of_the_spin_is_exact_but_for_a_sail_at_rest():
    """It is 1 or -1 from 1e-5 rad/s on, odd, and without a jump: a hub that swings through its rest would
    otherwise switch the voltages of its law, at every swing."""
    none = jnp.zeros(3)
    at = Measurements(jnp.zeros(()), none, none, none)
    rates = jnp.linspace(-2e-5, 2e-5, 4001)
    sense = jax.vmap(lambda rate: at._replace(spin_rate=rate).sense)(rates)
    turning = jnp.abs(rates) >= 1e-5
    assert (sense[turning] == jnp.sign(rates[turning])).all()
    np.testing.assert_allclose(sense, -sense[::-1], rtol=0, atol=1e-14)  # rounding
    assert 0.0 < jnp.diff(sense).max() < 2e-3
