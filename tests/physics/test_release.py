"""Tethers that are released at their roots during a run (`[[event]]`)."""

import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.scenes.loading import load_scene, parse
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.structure import split
from esail_jax.scenes.toml_text import to_toml
from support.quick import build_jitted, jit
from support.whole_runs import check_going_on

RELEASE = {"event.time": [100.3], "event.release": [2]}
SMALL = RELEASE | {
    "tethers.count": 3,
    "tethers.elements": 2,
    "integrator.t_end": 200.0,
    "output.interval": 10.0,
}
"""Overrides for three tethers of two elements. The second tether is released between two saved instants,
and within a step of a fixed-step method."""

METHODS = {
    "collocation": {"integrator.method": "collocation"},
    "generalized-alpha": {"integrator.method": "generalized-alpha", "integrator.spectral_radius": 0.9},
    "energy-momentum": {"integrator.method": "energy-momentum"},
}
SLOW = pytest.mark.nightly


def free_sail(method: str) -> Scene:
    """A sail without wind and damping, on which only internal forces act."""
    scene = load_scene("voltage-off", SMALL | METHODS[method])
    text = to_toml(scene)
    kept = [line for line in text.splitlines() if "damping_time" not in line]
    return parse("\n".join(kept), "free sail")


@pytest.mark.nightly
@pytest.mark.parametrize("method", ["collocation", "generalized-alpha"])
def test_released_tether_keeps_its_momentum(method):
    """A released tether keeps the momentum that it has at the release, and the rest of the sail the
    opposite one.

    The sail rotates as a rigid body, so that this momentum is omega x (first moment of mass). The rotation
    is steady but for a vibration of unbalanced elements, 1e-8 of the velocities.
    """
    scene = free_sail(method)
    solution = esail.simulate(scene)
    model = build_jitted(*split(scene))
    system, spin, time = model.system, 4e-3, RELEASE["event.time"][0]

    def momentum(tether):
        return np.asarray(system.tethers.inertia(tether)[0].sum(1))

    turn = np.asarray(solution["rotation_IB"])[0]
    about = np.array([[1, 0, 0], [0, np.cos(spin * time), -np.sin(spin * time)],
                      [0, np.sin(spin * time), np.cos(spin * time)]])  # fmt: skip
    expected = turn @ about @ turn.T @ momentum(model.v.tether)[:, 1]
    final = solution.final_state.v
    size = np.linalg.norm(expected)
    assert np.abs(momentum(final.tether)[:, 1] - expected).max() < 1e-6 * size
    assert np.abs(np.asarray(system.momentum(final))).max() < 1e-9 * size


@pytest.mark.nightly
def test_energy_goes_through_a_release():
    """A release does no work: a sail without wind and damping keeps its energy to 1e-9.

    The bound is ten times the effect of collocation's tolerance. The released root has no reaction and
    moves away from the hub; the other two tethers pull the hub out of its place. The released tether
    springs back, and the run says that it goes slack.
    """
    solution = esail.simulate(free_sail("collocation"))
    energy = solution["kinetic_energy"] + solution["elastic_energy"]
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-9
    assert solution.stats["message"].startswith("Tether 2 goes slack")
    before = solution.time < RELEASE["event.time"][0]
    force = np.linalg.norm(solution["reaction_B"], axis=2)
    assert (force[before] > 0.2).all() and (force[~before][:, [0, 2]] > 0.1).all()
    assert (force[~before][:, 1] < 1e-12).all()
    assert np.abs(solution["hub_position_I"][before]).max() < 1e-3
    assert np.abs(solution["hub_position_I"][-1]).max() > 1e-2


@pytest.mark.nightly
def test_methods_agree_on_what_follows():
    """Collocation and the fixed-step methods at 0.1 s agree on the tips to a millimetre of 10 km.

    The sail has wind and damping. The fixed steps do not resolve the axial waves that a release causes.
    """
    ends = [esail.simulate("baseline", SMALL | method)["tip_position_I"][-1] for method in METHODS.values()]
    assert np.abs(ends[1] - ends[0]).max() < 1e-3
    assert np.abs(ends[2] - ends[0]).max() < 1e-3


@pytest.mark.nightly
def test_tether_of_a_turning_frame_flies_on():
    """A tether that a turning frame releases flies on; the energy balance includes the work of the frame.

    The balance closes to 1e-9 of the energy.
    """
    text = to_toml(load_scene("baseline", SMALL | METHODS["collocation"]))
    hubless = "\n\n".join(table for table in text.split("\n\n") if not table.startswith("[hub]"))
    solution = esail.simulate(parse(hubless, "frame"))
    error = np.abs(solution["energy_balance_error"]).max()
    assert error < 1e-9 * solution["kinetic_energy"].max()
    assert np.linalg.norm(solution["reaction_B"][-1, 1]) < 1e-12


@pytest.mark.nightly
@pytest.mark.parametrize("method", ["collocation", "generalized-alpha"])
def test_run_goes_on_after_a_release(method, tmp_path):
    """A run file that is continued from before or from after the event is bit-identical to that of one
    run."""
    settings = SMALL | METHODS[method]
    check_going_on(settings, 50.0, 200.0, tmp_path)
    for path in tmp_path.iterdir():
        path.unlink()
    check_going_on(settings, 150.0, 200.0, tmp_path)


@pytest.mark.nightly
def test_a_run_that_starts_after_a_release_does_not_join_the_tether_again():
    """A run from the state after the event agrees with the whole run, on the host and traced.

    The bound, 1e-7 m of kilometres, is the effect of the tolerance: the steps are others."""
    settings = SMALL | METHODS["collocation"]
    whole = esail.simulate("baseline", settings)
    state = esail.simulate("baseline", settings | {"integrator.t_end": 150.0}).final_state

    def tips():
        return esail.simulate("baseline", settings, start=state)["tip_position_I"][-1]

    for found in (tips(), jit(tips)()):
        np.testing.assert_allclose(found, whole["tip_position_I"][-1], rtol=0, atol=1e-7)


def test_events_of_a_file():
    """`[[event]]` tables are read and written, and stay when other values change."""
    events = "[[event]]\ntime = 5\nrelease = 2\n\n[[event]]\ntime = 2.5\nrelease = 12\n"
    scene = parse(to_toml(load_scene("baseline")) + events, "text")
    assert (scene.event.time, scene.event.release) == ((5.0, 2.5), (2, 12))
    again = parse(to_toml(scene.replace({"voltage.value": 1e3})), "again")
    assert again.event == scene.event


def test_scene_without_events_pays_nothing():
    """The compiled system of a scene without events contains nothing of a release."""
    model = build_jitted(*split(load_scene("baseline", {"tethers.count": 3, "tethers.elements": 2})))
    assert model.system.roots.releases.release_time is None
    assert model.system.with_events_until(jnp.asarray(1e9)) is model.system
