"""One door: numbers are checked and converted in the same way, whichever way they come."""

import ast
import contextlib
from decimal import Decimal
from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.coordinates import Coordinates
from esail_jax.ensembles.sampling import checked_inputs
from esail_jax.errors import InputError
from esail_jax.simulation.arguments import check_arguments, check_times
from esail_jax.simulation.traced import Traced
from esail_jax.simulation.under_trace import failed_unless
from esail_jax.steppers.results import RESULTS, name_of
from esail_jax.steppers.stepper import Point
from esail_jax.system import Power


class Labelled:
    """A series with labels, as pandas has them: `x[i]` is the entry with the label i, not the i-th one."""

    def __init__(self, values, labels):
        self.values, self.labels = list(values), list(labels)

    def __getitem__(self, label):
        return self.values[self.labels.index(label)]

    def __len__(self):
        return len(self.values)

    def __array__(self, dtype=None, copy=None):
        return np.asarray(self.values, dtype)


SAIL = {"tethers.count": 3, "integrator.t_end": 100.0}
WIND = {"solar_wind.time": [0.0, 100.0], "solar_wind.speed": [4e5, 5e5]}


def sail(**more):
    return esail.load_scene("baseline", SAIL | more)


def point(scene, time=0.0, **shapes):
    """A point with coordinates of the shapes of a scene, or of other ones."""
    t = scene.tethers
    found = {"tether": (2, 3, t.elements + 1, t.count), "hub": (4, 3), "ring": None} | shapes
    q = Coordinates(**{name: None if x is None else jnp.zeros(x) for name, x in found.items()})
    zero = jnp.zeros(())
    return Point(jnp.asarray(time), q, q, Power(zero, zero), jnp.asarray(True))


@pytest.mark.parametrize(
    "start, message",
    [
        (
            {"tether": (2, 3, 6, 4)},
            r"`start.q.tether` must have the shape \(2, 3, 6, 3\), but has \(2, 3, 6, 4\)",
        ),
        ({"tether": (1, 3, 6, 3)}, r"`start.q.tether` must have the shape"),
        ({"hub": None}, r"`start.q.hub` must have the shape \(4, 3\), but has None"),
        ({"ring": (3, 2, 3)}, r"`start.q.ring` must have the shape None, but has \(3, 2, 3\)"),
        ({"time": 101.0}, r"`start.time` must not be later than `integrator.t_end` \(100\), but is 101"),
    ],
)
def test_a_start_of_another_sail_is_refused(start, message):
    """Before anything is compiled, and with the name of what differs."""
    scene = sail()
    with pytest.raises(InputError, match=message):
        check_arguments(scene, None, None, point(scene, **start), None)


def test_traced_instants_are_refused_with_a_way_out():
    scene = sail()

    def run(time):
        check_times(scene, [time, time + 1.0], point(scene)._replace(time=time))

    with pytest.raises(InputError, match=r"`times` must be plain numbers, but is traced \(`start._replace"):
        jax.jit(run)(0.0)


def test_a_traced_start_must_be_the_first_instant_of_the_run():
    """The windows of a traced run begin at its first saved instant. A traced time of the start has no value
    before the program runs; a run from elsewhere then fails, and so does its derivative."""
    rows, last = {"coning_angle": jnp.ones((2, 3))}, point(sail())
    run = Traced(rows, last, RESULTS.successful, jnp.ones(2), {})
    same, other = (failed_unless(jnp.asarray(x), run, jnp.zeros(())) for x in (True, False))
    assert name_of(same.result) == "successful" and (same.rows["coning_angle"] == 1.0).all()
    assert name_of(other.result) == "other_start" and np.isnan(other.rows["coning_angle"]).all()
    elsewhere = jnp.asarray(False)
    slope = jax.grad(lambda x: failed_unless(elsewhere, run._replace(rows={"x": x}), 0.0 * x).rows["x"])(
        1.0
    )
    assert np.isnan(slope)


def test_a_wind_is_not_extrapolated():
    """Not by `times`, by `t_end`, or by a start behind its end."""
    scene = sail(**WIND)
    check_arguments(scene, None, [0.0, 100.0], None, None)
    with pytest.raises(
        InputError, match=r"`times` must not go beyond `solar_wind.time` \(100\), but has 300"
    ):
        check_arguments(scene, None, [0.0, 100.0, 300.0], None, None)
    with pytest.raises(InputError, match=r"`solar_wind.time` must reach from 0"):
        sail(**WIND | {"integrator.t_end": 101.0})
    with pytest.raises(InputError, match=r"`start.time` must not be later"):
        check_arguments(scene, None, None, point(scene, 200.0), None)


def test_masked_numbers_are_refused():
    """A mask is no number, and the number below it is not meant."""
    speed = np.ma.masked_array([4e5, 9.999e6], [False, True])
    with pytest.raises(InputError, match=r"`solar_wind.speed` must hold no masked numbers, but has 1"):
        sail(**WIND | {"solar_wind.speed": speed})
    with pytest.raises(
        InputError, match=r"`inputs\[solar_wind.speed\]` must hold no masked numbers, but has 1"
    ):
        checked_inputs(sail(), {"solar_wind.speed": speed})
    assert sail(**WIND | {"solar_wind.speed": np.ma.masked_array([4e5, 5e5])}).solar_wind.speed == (
        4e5,
        5e5,
    )


@pytest.mark.parametrize(
    "value, expected",
    [(np.bool_(True), True), (np.array(True), True), (jnp.asarray(True), True), (False, False)],
)
def test_truth_values_of_numpy_are_truth_values(value, expected):
    assert sail(**{"solar_wind.relative": value}).solar_wind.relative is expected


@pytest.mark.parametrize("value", [4, np.int64(4), np.array(4), jnp.asarray(4), np.uint8(4)])
def test_integers_without_axes_are_integers(value):
    assert sail(**{"tethers.elements": value}).tethers.elements == 4
    assert sail(**{"tethers.length": value}).tethers.length == 4.0


@pytest.mark.parametrize("value", [np.float64(4.0), np.array(4.5), "4", np.array([4])])
def test_other_numbers_are_no_integers(value):
    with pytest.raises(InputError, match=r"`tethers.elements` must be"):
        sail(**{"tethers.elements": value})


@pytest.mark.parametrize("form", [np.array, np.str_])
def test_names_in_strings_of_numpy_are_names(form):
    assert sail(**{"tethers.root": form("clamped")}).tethers.root == "clamped"


ODD = [
    np.array([1.0, 2.0, 3.0], object), np.array(["1", "2", "3"]), np.array([1, 2, 3], "m8[s]"),
    np.array([1 + 0j]), np.array([4]), np.array([True, False, True]), np.array(4, object),
    np.array(True, object), np.array("true"), np.str_("4"), "4", "true", 4.0, 1, [4], [True], {"a": 1},
    {1.0}, b"1", Fraction(4), Decimal(4), None, (), [[]], range(3),
    10**20, 10**400, np.timedelta64(3, "s"), jnp.array(3.0, jnp.bfloat16), [10**20], 1e400,
]  # fmt: skip
"""Values that many keys refuse although some of them look like values that these take."""


KEYS = (
    "tethers.count", "tethers.root", "tethers.bending", "tethers.length", "voltage.value",
    "solar_wind.speed",
)  # fmt: skip


@pytest.mark.parametrize("key", KEYS)
def test_no_message_contradicts_itself(key):
    """What a message says that the value is would be refused, too: "must be a positive integer, but is 4"
    helps nobody. A value of another type that prints like a good one is named by its type."""
    for value in ODD:
        try:
            sail(**{key: value})
        except InputError as error:
            said = str(error).rpartition("but is ")[2]
            with contextlib.suppress(ValueError, SyntaxError):
                read = ast.literal_eval({"true": "True", "false": "False"}.get(said, said))
                with pytest.raises(InputError):
                    sail(**{key: read})


def test_integers_beyond_64_bits_and_short_numbers_are_numbers():
    """Integers have no largest one in Python; those beyond the largest number are refused as such."""
    assert sail(**{"tethers.length": 10**20}).tethers.length == 1e20
    assert float(sail(**{"tethers.length": jnp.array(3.0, jnp.bfloat16)}).tethers.length) == 3.0
    with pytest.raises(InputError, match=r"`tethers.length` must be a number below 1e308, but is 100"):
        sail(**{"tethers.length": 10**400})
    with pytest.raises(InputError, match=r"`tethers.count` must be at most 1e\+30, but is 100"):
        sail(**{"tethers.count": 10**400})


def test_lists_with_traced_numbers_are_arrays():
    """A list of a tracer and plain numbers is one traced array of float64; one that fits nothing is
    refused."""

    def volts(x):
        scene = sail(**{"voltage.value": [x, 2e4, 3 * x]})
        assert scene.voltage.value.dtype == np.float64
        return scene.voltage.value.sum()

    value, slope = jax.value_and_grad(volts)(1e4)
    assert float(value) == 6e4 and float(slope) == 4.0
    with pytest.raises(InputError, match=r"`voltage.value` must be"):
        jax.grad(lambda x: sail(**{"voltage.value": [x, [2e4]]}).voltage.value.sum())(1e4)


@pytest.mark.parametrize("kind", [np.float32, np.int32, jnp.float32])
def test_numbers_of_another_type_become_float64(kind):
    array = jnp.asarray([1, 2, 3], kind)
    assert sail(**{"voltage.value": array}).voltage.value.dtype == np.float64


@pytest.mark.parametrize(
    "values",
    [[1e4, 1.1e4], (1e4, 1.1e4), np.array([10000, 11000]), np.array([1e4, 1.1e4], np.float32),
     jnp.array([1e4, 1.1e4]), Labelled([1e4, 1.1e4], [1, 0])],
    ids=["list", "tuple", "integers", "float32", "JAX", "labelled"],
)  # fmt: skip
def test_inputs_of_members_are_taken_by_position(values):
    found = checked_inputs(sail(), {"tethers.length": values})["tethers.length"]
    assert found.dtype == np.float64 and np.allclose(found, [1e4, 1.1e4], rtol=1e-7)


def test_inputs_of_members_may_be_vectors():
    """They cannot be drawn, as a distribution is one of numbers, but given: one vector for each member."""
    direction = np.array([[1.0, 0.0, 0.0], [0.6, 0.8, 0.0]])
    scene = sail(**{"initial.heliocentric_position_au": direction[0]})
    found = checked_inputs(scene, {"initial.heliocentric_position_au": direction})
    assert np.array_equal(found["initial.heliocentric_position_au"], direction)


@pytest.mark.parametrize(
    "inputs, message",
    [
        ({"hub.density": [884.0, -884.0]}, r"`hub.density` must be positive, but is -884.0 \(member 1\)"),
        (
            {"remote_units.mass": [0.1, -0.1]},
            r"`remote_units.mass` must not be negative, but is -0.1 \(member 1\)",
        ),
        ({"tethers.length": [1e4, np.nan]}, r"`tethers.length` must be finite, but is nan \(member 1\)"),
        (
            {"initial.sailing_angle_deg": [0.0, 370.0]},
            r"`initial.sailing_angle_deg` must lie in .*370.0 \(member 1",
        ),
        (
            {"tethers.length": [1e4, 1e4], "voltage.value": [2e4]},
            "must have 2 members, as `inputs.tethers.length",
        ),
        ({"tethers.lenght": [1e4]}, r"`tethers.lenght` must be a known key \(perhaps `tethers.length`"),
        (
            {"tethers.count": [3, 4]},
            "`tethers.count` must be a physical number to be varied, but is structure",
        ),
        ({"tethers.length": ["a", "b"]}, r"`inputs\[tethers.length\]` must have a value for every member"),
        ({"tethers.length": 1e4}, r"`inputs\[tethers.length\]` must have a value for every member"),
        ({}, "`inputs` must have a value for every member, but is empty"),
    ],
)
def test_inputs_of_members_are_checked_as_those_of_a_run(inputs, message):
    with pytest.raises(InputError, match=message):
        checked_inputs(sail(), inputs)
