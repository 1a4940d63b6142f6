"""A hub that is a spacecraft: mass, inertia tensor, centre of mass, and places of the roots."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.elements.rigid_body import Spacecraft
from esail_jax.scenes.build import root_places
from esail_jax.scenes.hub import azimuths, root_positions
from esail_jax.scenes.loading import load_scene, parse
from esail_jax.scenes.plausibility import doubts
from esail_jax.scenes.structure import split
from esail_jax.scenes.toml_text import to_toml
from support.derivatives import check_both_modes
from support.quick import build_jitted
from support.ring_sail import reference

SMALL = {"tethers.count": 3, "tethers.elements": 1, "integrator.t_end": 60.0, "output.interval": 5.0}
NO_CYLINDER = {"hub.height": None, "hub.radius": None, "hub.density": None}
ODD = NO_CYLINDER | {
    "hub.mass": 20.0,
    "hub.inertia": [[30.0, 1.0, 2.0], [1.0, 40.0, -3.0], [2.0, -3.0, 55.0]],
    "hub.centre": [0.05, -0.1, 0.02],
    "hub.roots": [[0.1, 0.5, 0.1], [-0.1, -0.3, 0.4], [0.0, -0.2, -0.6]],
}
"""A hub without any symmetry."""

MASS, RADIUS, HEIGHT = 884.0 * np.pi * 2.0, 1.0, 2.0
ACROSS = MASS * (3.0 * RADIUS**2 + HEIGHT**2) / 12.0
LIKE_CYLINDER = {
    "hub.height": None, "hub.density": None, "hub.mass": MASS,
    "hub.inertia": [[0.5 * MASS, 0.0, 0.0], [0.0, ACROSS, 0.0], [0.0, 0.0, ACROSS]],
}  # fmt: skip
"""The cylinder of the baseline, by its mass and inertia."""


@pytest.mark.nightly
def test_run_follows_an_independent_integration(validate):
    """A hub without symmetry, with unequal tethers: every signal agrees with the independent code to 1e-6
    of its range. The hub tumbles within the run."""
    unequal = {
        "tethers.length": [9e3, 10e3, 11e3], "remote_units.mass": [0.4, 0.5, 0.6],
        "tethers.bending": False, "tethers.second_moment": None, "tethers.bending_damping_time": None,
        "initial.coning_angle_deg": 0.0, "integrator.tolerance": 1e-12,
    }  # fmt: skip
    scene = load_scene("baseline", SMALL | ODD | unequal)
    run = esail.simulate(scene)
    exact = reference(scene).run(np.asarray(run.time))
    found = {}
    for name, x in exact.items():
        ours = np.asarray(run[name])
        found[name] = np.abs(ours - x).max() / max(np.ptp(x), 1e-9 * np.abs(x).max(), 1e-300)
    worst = max(found, key=found.get)
    case, by = "hub without symmetry, three unequal tethers", "independent code, Runge-Kutta of order 8"
    validate("CRAFT-1", case, by, "worst signal / range", found[worst], 1e-6)
    assert np.abs(run["angular_velocity_B"][:, 1:]).max() > 4e-3


@pytest.mark.nightly
def test_a_spacecraft_like_the_cylinder_moves_like_it():
    """Other base points and the same body: every observable is the same to 1e-7 of its size (dissipation,
    which is the smallest; the error estimate has another hub)."""
    fine = SMALL | {"integrator.tolerance": 1e-12}
    cylinder, craft = (esail.simulate("baseline", fine | x) for x in ({}, LIKE_CYLINDER))
    azimuth = 2.0 * np.pi * np.arange(3) / 3.0
    roots = np.stack([0.0 * azimuth, np.cos(azimuth), np.sin(azimuth)], axis=1)
    placed = LIKE_CYLINDER | {"hub.radius": None, "hub.roots": roots.tolist()}
    other = esail.simulate("baseline", fine | placed)
    for name in cylinder:
        size = np.abs(cylinder[name]).max()
        if name != "energy_balance_error" and np.isfinite(size):
            for run in (craft, other):
                np.testing.assert_allclose(
                    run[name], cylinder[name], rtol=0, atol=1e-7 * size, err_msg=name
                )


def test_places_of_roots():
    """Roots are where they are said to be, tethers point away from the axis, and an observer's angles of
    straight tethers are zero; a root on the axis has its even azimuth. The functions for figures agree."""
    on_axis = ODD | {"hub.roots": [[0.1, 0.5, 0.1], [-0.1, 0.0, 0.0], [0.0, -0.2, -0.6]]}
    scene = load_scene("baseline", SMALL | on_axis | {"initial.coning_angle_deg": 0.0})
    structure, numbers = split(scene)
    places = root_places(structure, numbers)
    positions, angles = np.array(on_axis["hub.roots"]).T, azimuths(scene.hub, 3)
    np.testing.assert_allclose(places.arms, positions, atol=1e-15)
    np.testing.assert_allclose(places.radius, np.hypot(*positions[1:]), atol=1e-15)
    np.testing.assert_allclose(root_positions(scene.hub, 3), positions, atol=1e-15)
    np.testing.assert_allclose(places.azimuth, angles, atol=1e-15)
    assert angles[1] == pytest.approx(2.0 * np.pi / 3.0)
    model = build_jitted(structure, numbers)
    roots = model.q.tether[0, :, 0]
    rotation = np.asarray(model.system.rotation(jnp.zeros(()), model.q))
    np.testing.assert_allclose(rotation.T @ roots, positions, atol=1e-12)
    chords = rotation.T @ (model.q.tether[0, :, -1] - roots)
    np.testing.assert_allclose(chords / np.linalg.norm(chords, axis=0), places.outward, atol=1e-12)
    gradient = jax.grad(lambda x: root_places(structure, numbers | {"hub.roots": x}).radius.sum())
    assert np.isfinite(gradient(numbers["hub.roots"])).all()


FIXED = {"integrator.step": 0.1}
METHODS = {
    "collocation": {"integrator.tolerance": 1e-12},
    "generalized-alpha": FIXED | {"integrator.method": "generalized-alpha"},
    "energy-momentum": FIXED | {"integrator.method": "energy-momentum"},
}


@pytest.mark.nightly
@pytest.mark.parametrize("method", METHODS)
def test_derivatives_by_every_number_of_a_spacecraft(method):
    """Forward mode against differences (1e-6), reverse against forward mode (1e-10), of the hub's rates
    and the tips after 4 s. The roots' places are numbers on which the coupling of hub and tethers
    depends, and nothing else does."""

    def signals(numbers):
        short = {"integrator.t_end": 4.0, "output.interval": 4.0}
        given = SMALL | ODD | METHODS[method] | short | numbers
        run = esail.simulate("baseline", given, save=["angular_velocity_B", "tip_position_I"])
        return {"rate": 1e3 * run["angular_velocity_B"][-1], "tips": 1e-4 * run["tip_position_I"][-1]}

    symmetric = np.array([[0.3, 0.1, -0.2], [0.1, -0.4, 0.15], [-0.2, 0.15, 0.2]])
    numbers = {
        "hub.mass": (20.0, 0.2),
        "hub.inertia": (np.array(ODD["hub.inertia"]), 0.1 * symmetric),
        "hub.centre": (np.array(ODD["hub.centre"]), np.array([1e-4, -2e-4, 1e-4])),
        "hub.roots": (np.array(ODD["hub.roots"]), 1e-4 * (np.arange(9.0).reshape(3, 3) - 3.0)),
    }
    errors = check_both_modes(signals, numbers)
    assert max(errors.values()) < 1e-6, errors


@pytest.mark.nightly
def test_modes_of_a_spacecraft_like_the_cylinder():
    """Frequencies are those of the cylinder, to 1e-6: other base points, and the same body."""
    calm = SMALL | {"voltage.value": 0.0}
    tables = [esail.modes("baseline", calm | x, converge=False) for x in ({}, LIKE_CYLINDER)]
    ours, theirs = (np.sort(table.frequency_hz)[:12] for table in tables)
    np.testing.assert_allclose(ours, theirs, rtol=1e-6)


def test_a_spacecraft_is_written_and_read():
    """Digit for digit, with a tensor and a list of vectors."""
    scene = load_scene("baseline", SMALL | ODD)
    assert parse(to_toml(scene), "scene").hub == scene.hub


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"hub.centre": [50.0, 0.0, 0.0]}, "`hub.centre` is 50 m from the hub centre, and"),
        ({"hub.roots": [[0.0, 700.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]}, "`hub.roots` is 700 m"),
        ({"hub.roots": [0.0, 0.4, 0.0]}, "`hub.roots` gives several tethers the same root"),
    ],
)  # fmt: skip
def test_an_odd_spacecraft_is_doubted(given, sentence):
    (said,) = doubts(load_scene("baseline", SMALL | ODD | given))
    assert said.startswith(sentence)
    assert not any("hub." in x for x in doubts(load_scene("baseline", SMALL | ODD)))


def test_both_entries_beside_the_diagonal_have_the_same_derivative():
    """Of an inertia tensor only the symmetric part counts, also under a trace, where none is refused."""

    def kinetic(inertia):
        moments = Spacecraft.of(jnp.asarray(5.0), inertia, jnp.array([0.1, 0.0, 0.2])).mass_matrix
        return (moments * jnp.arange(16.0).reshape(4, 4)).sum()

    slope = jax.grad(kinetic)(jnp.diag(jnp.array([3.0, 4.0, 5.0])))
    assert np.array_equal(slope, slope.T)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"hub.mass": 5.0}, r"`hub.height` must be left out with `hub.mass`, but is given"),
        (ODD | {"hub.mass": None}, r"`hub.mass` must be given with `hub.inertia`, but is missing"),
        (ODD | {"hub.inertia": None}, r"`hub.inertia` must be given with `hub.mass`, but is missing"),
        (ODD | {"hub.roots": None}, r"`hub.roots` must be given, or `hub.radius`, but neither is"),
        (ODD | {"hub.radius": 1.0}, r"`hub.roots` must be given, or `hub.radius`, but both are"),
        (ODD | {"hub.mass": -1.0}, r"`hub.mass` must be positive, but is -1.0"),
        (ODD | {"hub.inertia": [1.0, 2.0, 3.0]}, r"`hub.inertia` must be a list of three lists of three"),
        (ODD | {"hub.inertia": [[3.0, 1.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 5.0]]},
         r"`hub.inertia` must be symmetric"),
        (ODD | {"hub.inertia": [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]]},
         r"moments of which each is less than the sum of the two others, but has 1, 2, 3"),
        (ODD | {"hub.inertia": [[-3.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 5.0]]}, "must have"),
        (ODD | {"hub.roots": [[0.0, 1.0, 0.0]] * 2}, r"`hub.roots` must be a vector or a list of 3"),
        ({"hub.density": None}, r"`hub.density` must be given, but is missing"),
        (ODD | {"initial.elongation": "paper"}, r"`hub.roots` must be left out with `initial.elongation`"),
    ],
)  # fmt: skip
def test_what_is_no_hub_is_refused(given, message):
    with pytest.raises(esail.SceneError, match=message):
        load_scene("baseline", SMALL | given)
