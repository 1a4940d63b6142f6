"""Thrust and moment by the closed formulas of mission analysis (`observables/reduced_models.py`)."""

import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.observables.reduced_models import (
    REDUCED,
    Profile,
    axisymmetric_moment,
    axisymmetric_thrust,
    flat_thrust,
)

NAMES = ("thrust_O", "thrust_moment_O", *REDUCED)
INCLINED = {"initial.sailing_angle_deg": 30.0}


@pytest.fixture(scope="module")
def observed(small):
    """The observables by name, time first, of a small sail with other numbers."""
    return lambda changes: esail.simulate("baseline", small | INCLINED | changes, save=NAMES)


def test_largest_angle_of_thrust():
    """The thrust of a flat sail is at most asin(1/3) = 19.47 deg away from the wind, at a sailing angle of
    54.7 deg (Huo et al. 2018); on a grid of 0.01 deg, to the square of its width."""
    alpha = np.deg2rad(np.arange(0.0, 90.0, 0.01))
    wind, ones = jnp.array([0.0, 0.0, 4e5]), jnp.ones(3)
    force = np.array([flat_thrust(ones, wind, jnp.array([np.sin(a), 0.0, np.cos(a)])) for a in alpha[::50]])
    exact = 0.5 * 3.0 * 4e5 * np.stack(
        [np.sin(alpha) * np.cos(alpha), 0 * alpha, 1.0 + np.cos(alpha) ** 2], 1
    )  # fmt: skip
    assert np.allclose(force, exact[::50], rtol=1e-13, atol=1e-6)
    angle = np.arctan2(exact[:, 0], exact[:, 2])
    assert abs(angle.max() - np.arcsin(1.0 / 3.0)) < 1e-7
    assert abs(np.rad2deg(alpha[angle.argmax()]) - 54.7356) < 0.01


def test_mean_over_the_azimuth():
    """Thrust and moment of a shape are those of 60 tethers of this shape, to rounding: products of three
    components have no harmonic above the third."""
    random = np.random.default_rng(4)
    slope, height, distance, push = random.normal(size=4) * [1.0, 5.0, 3.0, 1.0]
    c, s = np.cos(slope), np.sin(slope)
    shape = Profile(*(jnp.full((1, 1), x) for x in (s, c, height, distance, push)))
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    axes *= np.linalg.det(axes)
    n, wind = jnp.asarray(axes[:, 0]), jnp.asarray(random.normal(size=3))
    turn = 2.0 * np.pi * np.arange(60) / 60
    out = np.cos(turn)[:, None] * axes[:, 1] + np.sin(turn)[:, None] * axes[:, 2]
    tangent, point = c * out + s * n, distance * out + height * n
    force = push * (wind - (tangent @ wind)[:, None] * tangent)
    assert np.allclose(axisymmetric_thrust(shape, wind, n), force.mean(0), rtol=0, atol=1e-13)
    moment = np.cross(point, force).mean(0)
    # The part of the mean along n vanishes, as the tangents have no azimuthal component.
    assert np.allclose(axisymmetric_moment(shape, wind, n), moment, rtol=0, atol=1e-12)


def test_straight_tethers_of_equal_coning(observed, validate):
    """Three straight tethers on a cone have the thrust and the moment of the formula of a given shape; flat
    ones that of a flat sail. The wind is not parallel: 10 km / 1 au = 7e-8 of the thrust; 1e-6 is
    accepted."""
    coned, flat = observed({"initial.coning_angle_deg": 5.0}), observed({})
    for run, names in ((coned, REDUCED[2:]), (flat, REDUCED[:1])):
        for name in names:
            of = "thrust_moment_O" if "moment" in name else "thrust_O"
            exact, found = run[of][0], run[name][0]
            validate(
                f"RED {name}", "straight tethers on a cone", "direct integration over the tethers",
                name, np.abs(found - exact).max() / np.abs(exact).max(), 1e-6,
            )  # fmt: skip
    assert np.abs(coned["flat_sail_thrust_O"][0] / coned["thrust_O"][0] - 1.0)[[0, 2]].min() > 5e-3


def test_flat_sail_of_unequal_voltages(observed):
    """The moment of a flat sail with three voltages is that of the flexible sail at its flat start, but for
    the stretch of the tethers, 9e-4, which lengthens the arms: 1.5e-3 is accepted."""
    run = observed({"voltage.value": [20e3, 10e3, 15e3]})
    exact, found = run["thrust_moment_O"][0], run["flat_sail_thrust_moment_O"][0]
    assert np.abs(found - exact).max() < 1.5e-3 * np.abs(exact).max() and np.abs(exact).max() > 1.0


def test_only_on_request_and_with_wind(small, nothing_compiles):
    """A run has them where they are named; without wind they are refused in one line."""
    from esail_jax.ensembles.member_program import observable_shapes

    assert not set(REDUCED) & set(observable_shapes(esail.load_scene("baseline", small)))
    with pytest.raises(esail.SceneError, match=r"`save` must hold no 'flat_sail_thrust_O' without"):
        esail.simulate("voltage-off", small, save=["flat_sail_thrust_O"])
    with pytest.raises(esail.SceneError, match=r"`save` must hold no 'electric_power' without `teth"):
        esail.simulate("baseline", small, save=["electric_power"])
