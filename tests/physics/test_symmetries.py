"""A sail that is turned in space, that starts later, or whose tethers are numbered otherwise moves alike.

These hold for every law, load and observable: a term that refers to a fixed direction, to a fixed instant
or to the number of a tether by mistake breaks one of them.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.design.objectives import NAMES, values
from esail_jax.scenes.structure import split
from support.laws_and_loads import CASES, SAIL, P
from support.quick import build_jitted

DEFAULT = ("harmonic",)
EACH = [x if x in DEFAULT else pytest.param(x, marks=pytest.mark.nightly) for x in CASES]

ABOUT_Z = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
"""A turn about the normal of the ecliptic, with which the orbital frame turns."""

SHIFT = 1000.0
"""Delay of the whole run [s], a number whose sums with the instants here are exact."""

ROUNDING = {"energy_balance_error"}
"""The observable that is an error of the steps."""

ROUGH = {"dissipated_power": 1e-3}
"""Relative accuracy of the power of damping, which follows from differences of velocities: in a relaxed
sail these are 1e-9 m/s, and their rounding is 1e-13 m/s."""

OBJECTIVES = (*NAMES, "spin-plane:13,20", "spin-plane:13,20,200", "tension:5", "tension:0,1e-3")
"""All objectives of a design."""

NUMBERED = {"euler_sail", "euler_hub"}
"""Observables that refer to tether 1: angles about the spin axis."""


def at(scene, start=None):
    """A run from a start, and that start: the scene's own if None."""
    return esail.simulate("baseline", scene, start=start)


def compare(found, expected, left_out=ROUNDING):
    """Compares all observables, (name, rows), to 1e-5 of their largest entry. A mistake changes some
    observable by 1e-3 or more."""
    for name, rows in expected:
        if name in left_out:
            continue
        size = np.nanmax(np.abs(rows), initial=1e-300)
        bound = ROUGH.get(name, 1e-5) * size
        np.testing.assert_allclose(found[name], rows, rtol=0, atol=bound, err_msg=name)


def compare_objectives(found, expected):
    """Compares all objectives of two runs, but for 1e-12: those that are differences of unit vectors have
    the rounding of these. A mistake changes one by 1e-3 of it or more."""
    first, second = (np.array([*values(run, OBJECTIVES).values()]) for run in (found, expected))
    np.testing.assert_allclose(first, second, rtol=1e-4, atol=1e-12)


@pytest.mark.parametrize("case", EACH)
def test_a_sail_turned_in_space(case):
    """The Sun is seen in another direction. Components in I turn, those in O and B and all others stay."""
    scene = SAIL | CASES[case]
    place = np.array([0.6, 0.8, 0.0])
    run, turned = (
        at(scene | {"initial.heliocentric_position_au": (turn @ place).tolist()})
        for turn in (np.eye(3), ABOUT_Z)
    )

    def expected(name):
        rows = run[name]
        if name == "rotation_IB":
            return ABOUT_Z @ rows
        return rows @ ABOUT_Z.T if name.endswith("_I") else rows

    compare(turned, [(name, expected(name)) for name in run])
    compare_objectives(turned, run)


def delayed(scene):
    """The keys of a scene in which everything happens later. Tables begin with what they had at the
    start."""
    found = dict(scene) | {"integrator.t_end": scene["integrator.t_end"] + SHIFT}
    for key in ("voltage.on", "event.time"):
        if key in scene:
            found[key] = (np.asarray(scene[key]) + SHIFT).tolist()
    if "voltage.time" in scene:
        found["voltage.time"] = [0.0, *(np.asarray(scene["voltage.time"]) + SHIFT)]
        found["voltage.table"] = [scene["voltage.table"][0], *scene["voltage.table"]]
    return found


@pytest.mark.nightly
@pytest.mark.parametrize("case", CASES)
def test_a_sail_that_starts_later(case):
    """From the same state, with all instants of its tables, switches and events later by as much."""
    scene = SAIL | CASES[case]
    start = at(scene).final_state
    begin = start._replace(time=jnp.zeros(()))
    run = at(scene, begin)
    later = at(delayed(scene), begin._replace(time=jnp.asarray(SHIFT)))
    np.testing.assert_array_equal(later.time, run.time + SHIFT)
    compare(later, run.items())
    compare_objectives(later, run)


def renumbered(scene):
    """The keys of the sail whose tether i is tether i - 1 of another one."""
    found = dict(scene)
    for key, x in scene.items():
        if np.ndim(x) and np.shape(x)[-1] == P and key != "voltage.time":
            found[key] = np.roll(np.asarray(x), 1, -1).tolist()
    if "event.release" in scene:
        found["event.release"] = [i % P + 1 for i in scene["event.release"]]
    return found


def with_turned_axes(point, hub):
    """The same state in body axes that are turned about X_B, so that tether i is the one before."""
    rotation, centre = np.asarray(hub.rotation(point.q.hub)), np.asarray(hub.centre(point.q.hub))
    angle = -2.0 * np.pi / P
    turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    corners = (point.q.hub - centre) @ rotation  # components in B
    ones = np.ones((4, 1))
    weights = np.hstack([corners @ turn.T, ones]) @ np.linalg.inv(np.hstack([corners, ones]))

    def turned(x):
        return x._replace(tether=jnp.roll(x.tether, 1, -1), hub=weights @ x.hub)

    return point._replace(q=turned(point.q), v=turned(point.v)), turn


@pytest.mark.nightly
@pytest.mark.parametrize("case", CASES)
def test_a_sail_whose_tethers_are_numbered_otherwise(case):
    """The next tether has the numbers of this one, and the body axes point to it. Observables of tethers
    move on by one, components in B turn, all others stay."""
    scene = SAIL | CASES[case]
    start = at(SAIL | {"integrator.t_end": 1.0}).final_state
    start = start._replace(time=jnp.zeros(()))
    other, turn = with_turned_axes(
        start, build_jitted(*split(esail.load_scene("baseline", SAIL))).system.hub
    )
    run, moved = at(scene, start), at(renumbered(scene), jax.tree.map(jnp.asarray, other))

    def expected(name):
        rows, axes = run[name], esail.observables.described(name).axes
        if name == "rotation_IB":
            return rows @ turn
        rows = np.roll(rows, 1, 1) if "tether" in axes else rows
        return rows @ turn if name.endswith("_B") else rows

    compare(moved, [(name, expected(name)) for name in run], ROUNDING | NUMBERED)
    compare_objectives(moved, run)
