"""Parameters of a fit: their names, places, bounds, refusals, and where their numbers go in the scene."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import esail_jax as esail
from esail_jax.constants import THRUST_FACTOR
from esail_jax.identification.parameters import check_starts, overrides_of, parameters_of, shown_by
from support.measured_sail import SAIL, sail, shapes

MEASURED = ("spin_rate", "angular_velocity_B", "coning_angle", "kinetic_energy")


def found(*names, scene=None):
    """The parameters of names, with the observables above as data."""
    return parameters_of(scene or sail(), names, {name: shapes()[name] for name in MEASURED})


def test_a_name_stands_for_one_number_or_for_all_of_a_key():
    """Places count from 1 in names and from 0 in `place`; starts, units and bounds are those of the key."""
    one, *inertia = found("solar_wind.number_density", "hub.inertia[*]")
    assert one == (
        "solar_wind.number_density",
        "solar_wind.number_density",
        (),
        7.3e6,
        0.0,
        np.inf,
        "1/m^3",
    )
    upper = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]
    assert [p.place for p in inertia] == upper
    assert [p.name for p in inertia] == [f"hub.inertia[{i + 1},{j + 1}]" for i, j in upper]
    assert [p.start for p in inertia] == [SAIL["hub.inertia"][at] for at in upper]
    (roots,) = found("hub.roots[2,1]")
    assert roots[2:4] == ((1, 0), -0.01)
    bounds = {p.key: (p.low, p.high) for p in found("initial.spin_rate", "hub.mass", "hub.centre[1]")}
    assert bounds == {
        "initial.spin_rate": (-np.inf, np.inf), "hub.mass": (0.0, np.inf), "hub.centre": (-np.inf, np.inf),
    }  # fmt: skip


def test_an_entry_of_a_tensor_below_the_diagonal_is_the_one_above():
    """Three roots, with three components each, are no tensor."""
    assert found("hub.inertia[3,1]") == found("hub.inertia[1,3]")
    assert found("hub.inertia[3,1]")[0].name == "hub.inertia[1,3]"
    assert len(found("hub.roots[*]")) == 9


def test_one_number_of_all_tethers_becomes_one_of_each():
    assert [(p.name, p.start) for p in found("tethers.length[*]")] == [
        ("tethers.length[1]", 300.0), ("tethers.length[2]", 300.0), ("tethers.length[3]", 300.0),
    ]  # fmt: skip
    unequal = sail().replace({"tethers.length": [300.0, 310.0, 305.0]})
    assert [p.start for p in found("tethers.length[*]", scene=unequal)] == [300.0, 310.0, 305.0]
    assert found("tethers.length")[0].place == ()


def test_what_a_scene_may_leave_out_starts_at_its_value_without():
    """The factor of the paper, and no torque."""
    assert sail().solar_wind.thrust_factor is None and sail().hub.torque is None
    factor, *torque = found("solar_wind.thrust_factor", "hub.torque[*]")
    assert factor.start == THRUST_FACTOR
    assert [(p.name, p.start, p.unit) for p in torque] == [
        (f"hub.torque[{i}]", 0.0, "N m") for i in (1, 2, 3)
    ]


def test_instruments_have_a_bias_in_their_unit_and_three_angles():
    one, two = found("bias.spin_rate[*]")
    assert (one.name, one.start, one.low, one.unit) == ("bias.spin_rate[1]", 0.0, -np.inf, "rad/s")
    assert (two.name, two.of_instrument) == ("bias.spin_rate[2]", True)
    (energy,) = found("bias.kinetic_energy")
    assert (energy.place, energy.unit) == ((), "J")
    angles = found("misalignment.angular_velocity_B[*]")
    assert [(p.place, p.unit) for p in angles] == [((k,), "rad") for k in range(3)]
    assert not any(p.of_instrument for p in found("tethers.length", "hub.mass"))


REFUSALS = {
    ("thrust_factor",): "`free` must be keys such as tethers.length, KEY[2] or KEY[*], but has "
    "'thrust_factor'",
    ("tethers.lenght[*]",): "`tethers.lenght` must be a known key (perhaps `tethers.length`), but is not",
    ("tethers.length[4]",): "`free` must name one of the 3 places of tethers.length, but has "
    "tethers.length[4]",
    ("tethers.length[0]",): "`free` must name one of the 3 places of tethers.length, but has "
    "tethers.length[0]",
    ("solar_wind.speed[1]",): "`free` must be solar_wind.speed without brackets, as it is one number, "
    "but has solar_wind.speed[1]",
    ("hub.torque",): "`free` must say which numbers of hub.torque: hub.torque[*] or hub.torque[1], but has "
    "hub.torque",
    ("hub.inertia[1,4]",): "`free` must name one of the 3 x 3 places of hub.inertia, but has "
    "hub.inertia[1,4]",
    ("hub.inertia[2,1]", "hub.inertia[1,2]"): "`free` must name every number once, but has "
    "hub.inertia[1,2] twice",
    ("tethers.length[*]", "tethers.length[2]"): "`free` must name every number once, but has "
    "tethers.length[2] twice",
    ("tethers.area", "tethers.area[1]"): "`free` must name every number once, but has tethers.area and "
    "tethers.area[1]",
    ("tethers.area[1]", "tethers.area"): "`free` must name every number once, but has tethers.area and "
    "tethers.area[1]",
    ("hub.height",): "`hub.height` must have a value in the scene to be free, but has none",
    ("gravity.acceleration[1]",): "`gravity.acceleration` must have a value in the scene to be free, but "
    "has none",
    ("tethers.elements",): "`tethers.elements` must be a physical number to be free, but is structure",
    (
        "integrator.tolerance",
    ): "`integrator.tolerance` must be a number of the model to be free, but says how it is run",
    ("integrator.t_end",): "`integrator.t_end` must be a physical number to be free, but is structure",
    ("bias.spin_rat[1]",): "`free` must name observables of the data (spin_rate, angular_velocity_B, "
    "coning_angle, kinetic_energy), but has bias.spin_rat",
    ("bias.spin_rate[3]",): "`free` must name one of the 2 places of bias.spin_rate, but has "
    "bias.spin_rate[3]",
    ("misalignment.spin_rate[*]",): "`free` must have misalignments of vectors only, but has "
    "misalignment.spin_rate",
    (): "`free` must be a list of keys, but is ()",
}


@pytest.mark.parametrize("names", REFUSALS, ids=lambda names: "+".join(names) or "none")
def test_a_name_that_is_no_parameter_is_refused_in_one_line(names):
    with pytest.raises(esail.SceneError) as error:
        found(*names)
    assert str(error.value) == REFUSALS[names]


def test_a_text_is_no_list_of_names():
    with pytest.raises(esail.SceneError, match=r"^`free` must be a list of keys, but is 'hub.mass'$"):
        parameters_of(sail(), "hub.mass", {})


def test_a_start_outside_of_its_bounds_is_refused():
    (mass,) = found("hub.mass")
    with pytest.raises(esail.SceneError, match=r"^`hub.mass` must lie in \[0, inf\], but is -1$"):
        check_starts([mass._replace(start=-1.0)])
    check_starts([mass])


def test_numbers_go_where_their_names_say():
    """The scene with the overrides of a fit is the scene with the tables written out by hand: both entries
    of the tensor, one tether of two, one component of an absent torque."""
    names = (
        "hub.inertia[1,2]", "tethers.length[2]", "hub.torque[3]", "hub.mass", "solar_wind.thrust_factor",
        "hub.roots[1,3]", "bias.spin_rate[1]", "tethers.area",
    )  # fmt: skip
    values = np.array([0.7, 305.0, 0.02, 41.0, 0.2, 0.15, 1e-3, 4e-9])
    overrides = overrides_of(sail(), found(*names))(jnp.asarray(values))
    inertia, roots = SAIL["hub.inertia"].copy(), SAIL["hub.roots"].copy()
    inertia[0, 1] = inertia[1, 0] = 0.7
    roots[0, 2] = 0.15
    by_hand = {
        "hub.inertia": inertia, "tethers.length": [300.0, 305.0, 300.0], "hub.torque": [0.0, 0.0, 0.02],
        "hub.mass": 41.0, "solar_wind.thrust_factor": 0.2, "hub.roots": roots, "tethers.area": 4e-9,
    }  # fmt: skip
    assert overrides.keys() == by_hand.keys()
    for key, value in by_hand.items():
        np.testing.assert_array_equal(overrides[key], value, err_msg=key)
    plain = {key: np.asarray(x).tolist() for key, x in overrides.items()}
    assert sail().replace(plain) == sail().replace({k: np.asarray(x).tolist() for k, x in by_hand.items()})


def test_an_instrument_turns_what_is_true_and_adds_its_bias():
    """R(theta) h + b with the rotation of SciPy, about a vector that is not small, to rounding."""
    free = found("misalignment.angular_velocity_B[*]", "bias.angular_velocity_B[2]", "hub.mass")
    true = jnp.asarray(np.random.default_rng(1).standard_normal((5, 3)))
    theta, bias = np.array([0.3, -0.5, 0.4]), 0.7
    values = jnp.array([*theta, bias, 40.0])
    shown = shown_by(free, values, "angular_velocity_B", true)
    expected = Rotation.from_rotvec(theta).apply(np.array(true)) + np.array([0.0, bias, 0.0])
    np.testing.assert_allclose(shown, expected, rtol=0, atol=1e-14)
    # What has no instrument among the parameters stays as it is.
    np.testing.assert_array_equal(shown_by(free, values, "spin_rate", true[:, :2]), true[:, :2])


@pytest.mark.parametrize("angle", [0.0, 0.00999, 0.01001, 0.5])
def test_the_second_derivative_by_a_misalignment_exists_at_zero(angle):
    """Where every instrument starts, and on both sides of the angle at which the formula changes: second
    differences, of order four, of the rotation of SciPy. With a step of 0.05 rad their truncation is
    h^4/30 times the size of the vector, 2e-7, along either axis; rounding is 1e-13."""
    free = found("misalignment.angular_velocity_B[*]")
    true = np.random.default_rng(2).standard_normal((1, 3))
    at, step = angle * np.array([2.0, -1.0, 2.0]) / 3.0, 0.05

    def shown(theta):
        return shown_by(free, theta, "angular_velocity_B", jnp.asarray(true))[0]

    second = np.asarray(jax.hessian(shown)(jnp.asarray(at)))

    def slope(theta, i):  # of the rotation of SciPy along axis i
        turned = lambda n: Rotation.from_rotvec(theta + n * step * np.eye(3)[i]).apply(true[0])  # noqa: E731
        return (8.0 * (turned(1) - turned(-1)) - turned(2) + turned(-2)) / (12.0 * step)

    for i in range(3):
        for j in range(3):
            along = [slope(at + n * step * np.eye(3)[j], i) for n in (1, -1, 2, -2)]
            quotient = (8.0 * (along[0] - along[1]) - along[2] + along[3]) / (12.0 * step)
            np.testing.assert_allclose(second[:, i, j], quotient, rtol=0, atol=2e-6)
