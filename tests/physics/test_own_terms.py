"""Terms that users write (`physics.py`): what they do, their derivatives, and what is refused."""

import warnings

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.environment.circular_orbit import CircularOrbit
from esail_jax.environment.kepler_orbit import KeplerOrbit
from esail_jax.errors import InputError
from esail_jax.loads.own_terms import Surroundings
from esail_jax.observables import sail as observed
from esail_jax.physics import Energy, Field, HubLoad, Load, TipLoad
from esail_jax.scenes.build import build_chain
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.structure import split
from support.own_terms import (
    NO_WIND,
    SAIL,
    AxialPush,
    Bending,
    KelvinVoigt,
    Lorentz,
    Pulse,
    Stiffening,
    Thrust,
    Turning,
    Weight,
    Wrench,
)
from support.quick import build_jitted, jit

G = [2e-4, -1e-4, 3e-4]
FORCE, TORQUE = jnp.array([0.01, -0.02, 0.005]), jnp.array([0.3, 0.1, -0.2])


def made(overrides, terms=()):
    """The model of the small sail."""
    return build_jitted(*split(load_scene("baseline", SAIL | overrides | {"terms": terms})))


@jit
def residual(system, time, q, v):
    """Unbalanced forces and powers at rest, without multipliers, of a state."""
    nothing = jax.tree.map(jnp.zeros_like, q)
    return system.residual(time, q, v, nothing, system.no_multipliers())


def disturbed(model):
    """A state with curvature, stretch and rates, far from any symmetry."""
    random = np.random.default_rng(3)
    q, v = (
        jax.tree.map(lambda x, size=size: x + size * jnp.asarray(random.normal(size=x.shape)), c)
        for c, size in ((model.q, 1e-3), (model.v, 1e-2))
    )
    return jnp.asarray(7.0), q, v


def largest_difference(found, expected):
    """The largest difference of two results, as a fraction of the largest entry of its array."""
    pairs = zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True)
    return max(float(jnp.abs(a - b).max() / jnp.maximum(jnp.abs(b).max(), 1e-300)) for a, b in pairs)


PLAIN = {
    "tethers.youngs_modulus": 7e10,
    "tethers.bending": False,
    "tethers.second_moment": None,
    "tethers.bending_damping_time": None,
    "tethers.axial_damping_time": None,
}
STIFFER = PLAIN | {"tethers.youngs_modulus": 8.75e10}
TWO = {"tethers.elements": 2}
AREA = 4.28e-9
AXIAL = {"tip_thrust.direction": "axial"}

TWINS = {
    "Field": ({}, [Weight(jnp.array(G))], {"gravity.acceleration": G}),
    "TipLoad": ({}, [AxialPush(jnp.asarray(2e-3))], AXIAL | {"tip_thrust.force": 2e-3}),
    "TipLoad, a number per tether": (
        {}, [AxialPush(1e-3 * jnp.arange(3.0))], AXIAL | {"tip_thrust.force": [0.0, 1e-3, 2e-3]},
    ),
    "Energy": (PLAIN, [Stiffening(jnp.asarray(0.25 * 7e10 * AREA))], STIFFER),
    "Energy, a number per tether": (
        PLAIN | TWO, [Stiffening(7e10 * AREA * jnp.array([0.1, 0.2, 0.3]))],
        PLAIN | TWO | {"tethers.youngs_modulus": [7.7e10, 8.4e10, 9.1e10]},
    ),
    "Dissipation": (
        PLAIN, [KelvinVoigt(jnp.asarray(5e-3 * 7e10 * AREA))],
        PLAIN | {"tethers.axial_damping_time": 5e-3},
    ),
    "Energy of curvature": (
        PLAIN, [Bending(jnp.asarray(7e10 * 1e-18))],
        PLAIN | {"tethers.bending": True, "tethers.second_moment": 1e-18},
    ),
}  # fmt: skip
"""Terms of a user and the keys of the package that have the same meaning."""


@pytest.mark.parametrize("name", TWINS)
def test_a_term_does_what_the_same_term_of_the_package_does(name):
    """Forces and powers at a disturbed state, to rounding: 1e-12 of the largest entry."""
    plain, terms, keys = TWINS[name]
    own, package = made(plain, terms), made(plain | keys)
    state = disturbed(package)
    assert largest_difference(residual(own.system, *state), residual(package.system, *state)) < 1e-12
    assert largest_difference((own.q, own.v), (package.q, package.v)) < 1e-12


def test_a_load_does_what_the_thrust_of_the_package_does():
    """The same for Coulomb thrust, whose numbers are those of the wind."""
    package = made({})
    wind = package.system.loads[0].wind
    strength = wind.thrust_per_speed(package.system.loads[0].voltage_law.value)
    own = made(NO_WIND, [Thrust(wind.origin, wind.speed, strength)])
    state = disturbed(package)
    assert largest_difference(residual(own.system, *state), residual(package.system, *state)) < 1e-12


def test_wrench_has_the_power_of_force_and_torque():
    """On the hub's points, a force F and a torque T have the sum F, the moment r x F + T about the origin,
    and the power F . v + T . omega."""
    model = made({}, [Wrench(FORCE, TORQUE)])
    system, (time, q, v) = model.system, disturbed(model)
    q, v = model.q._replace(hub=model.q.hub + jnp.array([3.0, -2.0, 5.0])), v._replace(hub=model.v.hub)
    points = system.hub_forces(time, q, v)
    centre, omega = (
        system.hub.centre(q.hub),
        system.rotation(time, q) @ system.hub.angular_velocity(q.hub, v.hub),
    )
    np.testing.assert_allclose(points.sum(0), FORCE, rtol=1e-13)
    np.testing.assert_allclose(
        jnp.cross(q.hub, points).sum(0), jnp.cross(centre, FORCE) + TORQUE, rtol=1e-12
    )
    expected = FORCE @ system.hub.centre(v.hub) + TORQUE @ omega
    np.testing.assert_allclose((points * v.hub).sum(), expected, rtol=1e-12)


@pytest.mark.nightly
def test_a_wrench_changes_momentum_and_angular_momentum(validate):
    """In 20 s without wind, F t is the change of momentum, and T t plus the integral of the hub's position
    times F that of the angular momentum about the origin: to 1e-10 of F t and of the angular momentum. The
    work of both is the change of energy."""
    scene = SAIL | NO_WIND | {"integrator.tolerance": 1e-12}
    times = np.linspace(0.0, 20.0, 41)
    run = esail.simulate("baseline", scene, times=times.tolist(), terms=[Wrench(FORCE, TORQUE)])
    model, end = made(NO_WIND, [Wrench(FORCE, TORQUE)]), run.final_state
    system = model.system
    push = system.momentum(end.v) - system.momentum(model.v)
    validate("OWN-1", "small sail, force on the hub", "P(0) + F t", "momentum",
             float(np.abs(push - 20.0 * FORCE).max() / np.abs(20.0 * FORCE).max()), 1e-10)  # fmt: skip
    turn = system.angular_momentum(end.q, end.v) - system.angular_momentum(model.q, model.v)
    arms = np.cross(run["hub_position_I"], np.asarray(FORCE))
    # Simpson's rule: the hub's acceleration is all but constant between the instants.
    moment = 20.0 * TORQUE + (arms[0:-1:2] + 4.0 * arms[1::2] + arms[2::2]).sum(0) * (times[2] / 6.0)
    size = np.linalg.norm(system.angular_momentum(model.q, model.v))
    validate("OWN-2", "small sail, wrench on the hub", "L(0) + T t + int r x F", "angular momentum",
             float(np.abs(turn - moment).max() / size), 1e-10)  # fmt: skip
    assert abs(run["energy_balance_error"][-1]) < 1e-9 * run["external_work"][-1]


def test_lorentz_force_on_the_electron_current():
    """On straight tethers the whole force is the integral of I (1 - x/L) t x B dx = I L/2 t x B with the
    current I of the observable `electron_current`; `command` is therefore right, and with the integral of
    x^2, L^3/3, so is `x`."""
    field = jnp.array([3e-9, -4e-9, 5e-9])
    model = made({"tethers.wire_radius": 2e-5}, [Lorentz(field)])
    system, q, v = model.system, model.q, model.v
    thrust, own = system.loads
    measured = system.measurements(jnp.zeros(()), q, v)
    current = thrust.collector.current(jnp.zeros(()), thrust.voltage_law.value, None)
    np.testing.assert_allclose(own.commanded(measured), current, rtol=1e-14)
    commanded = system.with_commanded_loads(jnp.zeros(()), q, v)
    fields, rates = system.tethers.interpolate_motion(q.tether, v.tether)
    force = commanded.loads[1].force(jnp.zeros(()), fields, rates)
    total = system.tethers.of_tethers(
        jnp.tensordot(system.tethers.weights, force, (0, 1)) * system.tethers.lengths
    )
    squares = system.tethers.of_tethers((system.tethers.weights @ own.distance**2) * system.tethers.lengths)
    np.testing.assert_allclose(squares.sum(0), 10e3**3 / 3.0, rtol=1e-12)
    exact = 0.5 * current * 10e3 * jnp.cross(measured.chords, field[:, None], axis=0)
    np.testing.assert_allclose(total.sum(1), exact, rtol=1e-9)


@pytest.mark.nightly
def test_a_field_acts_on_a_chain_as_that_of_the_package():
    """The field of a circular orbit, and gravity, on a free chain of rods and on one that hangs: in
    relative coordinates (a user's fields take the way of nonlinear ones) to rounding."""
    for name in ("tethered-satellite", "hanging-chain"):
        plain = {"orbit": None, "gravity": None, "plasma_brake": None}
        known = {"gravity.acceleration": G}
        scene = load_scene(name, plain)
        own, package = (
            build_chain(*split(scene.replace(keys))) for keys in ({"terms": [Weight(jnp.array(G))]}, known)
        )
        time = jnp.zeros(())
        found, expected = own[0](time, own[1]), package[0](time, package[1])
        assert largest_difference(found[:2], expected[:2]) < 1e-11, name
    scene = load_scene("tethered-satellite", {"plasma_brake": None})
    rate = scene.orbit.mean_motion
    turning = scene.replace({"orbit": None, "terms": [Turning(float(rate))]})
    (own, at), (package, _) = build_chain(*split(turning)), build_chain(*split(scene))
    found, expected = (chain(time, at._replace(work=None)) for chain in (own, package))
    assert largest_difference(found[:2], expected[:2]) < 1e-9


def test_the_frame_of_a_term_is_that_of_the_scene():
    """When the orbit of the coordinates is rectified, their origin moves on another orbit than that of I:
    terms are given positions relative to the latter. The numbers are those of two orbits about the Sun."""
    first = jnp.array([1.5e11, 0.0, 0.0]), jnp.array([0.0, 3e4, 0.0])
    later = jnp.array([1.5e11 + 700.0, -30.0, 0.0]), jnp.array([0.0, 3e4 - 2.0, 0.5])
    around = Surroundings(first[0], KeplerOrbit(*later), first, None)
    position, velocity = around.shift(jnp.zeros(()))
    np.testing.assert_allclose(position, [700.0, -30.0, 0.0], atol=1e-4)  # of 1.5e11 m
    np.testing.assert_allclose(velocity, [0.0, -2.0, 0.5], atol=1e-10)
    assert Surroundings(first[0], None, None, None).shift(jnp.zeros(())) is None


class Seen(Field):
    """Gives back what it is given."""

    def acceleration(self, time, position, velocity):
        return position + 1e3 * velocity


class SeenByLoad(Load):
    def force(self, time, fields, rates):
        return fields.r + 1e3 * rates.r


class SeenByHub(HubLoad):
    def wrench(self, hub):
        return hub.position + 1e3 * hub.velocity, hub.sun


def test_terms_are_given_the_motion_relative_to_the_scene():
    """A field, a load and a load on the hub, while the coordinates have moved away from I; and the Sun is
    where the wind comes from."""
    first = jnp.array([1.5e11, 0.0, 0.0]), jnp.array([0.0, 3e4, 0.0])
    moved = KeplerOrbit(first[0] + 500.0, first[1] - 2.0)
    orbit = {"initial.heliocentric_position_au": None, "orbit.position_au": [1.0, 0.1, 0.0],
             "orbit.velocity": [0.0, 3e4, 0.0]}  # fmt: skip
    model = made(orbit, [Seen(), SeenByLoad(), SeenByHub()])
    around = Surroundings(first[0], moved, first, None)
    system = eqx.tree_at(
        lambda s: (s.fields[-1].around, s.loads[-1].around, s.hub_loads[0].around),
        model.system,
        (around,) * 3,
    )
    zero, r, v = jnp.zeros(()), jnp.array([[1.0], [2.0], [3.0]]), jnp.array([[4.0], [5.0], [6.0]])
    expected = r + 500.0 + 1e3 * (v - 2.0)
    np.testing.assert_allclose(system.fields[-1].acceleration(zero, r, v), expected, atol=1e-4)
    fields, rates = (system.tethers.interpolate(x.tether) for x in (model.q, model.v))
    force = system.loads[-1].force(zero, fields, rates)
    np.testing.assert_allclose(force, fields.r + 500.0 + 1e3 * (rates.r - 2.0), rtol=1e-9, atol=1e-4)
    hub = system.hub_motion(zero, model.q, model.v)
    found, sun = system.hub_loads[0].wrench(hub)
    np.testing.assert_allclose(found, hub.position + 500.0 + 1e3 * (hub.velocity - 2.0), atol=1e-4)
    place = np.array([1.0, 0.1, 0.0])
    np.testing.assert_allclose(sun, -place / np.linalg.norm(place), atol=1e-9)
    thrust = model.system.loads[0]
    measured = thrust.with_wind(model.system.measurements(zero, model.q, model.v))
    np.testing.assert_allclose(sun, measured.sun, atol=1e-14)


def test_the_iteration_matrix_knows_the_gradients_of_a_field():
    """The field of an orbit: its gradients by position and velocity are those of the package's field."""
    system = made({}, [Turning(2e-3), Weight(jnp.array(G))]).system
    model = made({})
    found = system.field_gradients(jnp.zeros(()), model.q, model.v)
    for a, b in zip(found, CircularOrbit(jnp.asarray(2e-3)).gradients, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-20)
    assert model.system.field_gradients(jnp.zeros(()), model.q, model.v) is None


@pytest.mark.nightly
def test_steps_end_at_the_knots_of_a_term():
    """A pulse of 5 s adds T/2 times 5 s of angular momentum along X_B to a hub that spins about it, where
    steps of the sail are three times as long: to 1e-9 of it."""
    scene = SAIL | NO_WIND | {"integrator.t_end": 20.0, "initial.coning_angle_deg": 0.0}
    run, free = (
        esail.simulate("baseline", scene, times=[20.0], terms=x) for x in ([Pulse()], [Pulse(0.0)])
    )
    model = made(NO_WIND, [Pulse()])
    gained = [model.system.angular_momentum(x.final_state.q, x.final_state.v) for x in (run, free)]
    axis = np.asarray(model.system.rotation(jnp.zeros(()), model.q))[:, 0]
    assert float((gained[0] - gained[1]) @ axis) == pytest.approx(0.5 * 0.2 * 5.0, rel=1e-6)


@pytest.mark.nightly
def test_derivatives_by_the_numbers_of_a_term(validate):
    """By sigma/u of every tether and by a torque: forward mode against differences (1e-6), reverse against
    forward mode (1e-10); and by the second derivative along a direction, forward over reverse, against the
    difference of gradients (1e-5). A batch gives the gradients one by one."""
    origin, speed = 1.5e11 * jnp.array([0.6, 0.8, 0.0]), jnp.asarray(4e5)

    def coning(x):
        terms = [
            Thrust(origin, speed, 1e-12 * x[:3]),
            Wrench(jnp.zeros(3), x[3] * jnp.array([0.0, 1.0, 0.0])),
        ]
        short = SAIL | NO_WIND | {"integrator.t_end": 10.0}
        run = esail.simulate("baseline", short, save=["coning_angle"], terms=terms)
        return 1e6 * run["coning_angle"][-1] @ jnp.array([1.0, 0.3, -0.5])

    x, along = jnp.array([1.0, 1.2, 0.9, 2.0]), jnp.array([0.3, -0.7, 0.5, 1.0])
    both = jit(lambda x, d: jax.jvp(jax.value_and_grad(coning), (x,), (d,)))
    (_, gradient), (slope, second) = both(x, along)
    step = 1e-3
    (above, g1), (below, g0) = (both(x + h * along, along)[0] for h in (step, -step))
    validate("OWN-3", "small sail, own terms", "difference quotient", "derivative by numbers of terms",
             float(abs((above - below) / (2 * step) / slope - 1.0)), 1e-6)  # fmt: skip
    assert float(gradient @ along) == pytest.approx(float(slope), rel=1e-10)
    np.testing.assert_allclose((g1 - g0) / (2 * step), second, rtol=0, atol=1e-5 * np.abs(second).max())
    many = jit(jax.vmap(jax.grad(coning)))(jnp.stack([x, x + step * along]))
    np.testing.assert_allclose(many, jnp.stack([gradient, g1]), rtol=1e-10)


# ---- what is refused --------------------------------------------------------------------------------


class OfTwo(HubLoad):
    def wrench(self, hub):
        return jnp.zeros(2), jnp.zeros(3)


class Alone(HubLoad):
    def wrench(self, hub):
        return jnp.zeros(3)


class Decides(HubLoad):
    def wrench(self, hub):
        return (jnp.zeros(3), jnp.zeros(3)) if hub.time > 3.0 else (jnp.ones(3), jnp.ones(3))


class Root(HubLoad):
    a: float = 0.0

    def wrench(self, hub):
        return jnp.sqrt(-1.0 - self.a) * jnp.ones(3), jnp.zeros(3)


class Misspelt(HubLoad):
    def wrench(self, hub):
        return hub.positon, jnp.zeros(3)


class Far(HubLoad):
    def wrench(self, hub):
        return 2.0 * hub.heliocentric_position, jnp.zeros(3)


class Product(HubLoad):
    def wrench(self, hub):
        return jnp.zeros(3) @ jnp.zeros(2), jnp.zeros(3)


class OneVector(Load):
    def force(self, time, fields, rates):
        return jnp.zeros(3)


class OneForAll(Field):
    def acceleration(self, time, position, velocity):
        return jnp.zeros(3)


class Plane(TipLoad):
    def force(self, measurements):
        return jnp.zeros((2, 3))


class Total(Energy):
    def deformation(self, invariants):
        return invariants.stretch_squared

    def energy_density(self, e):
        return e.sum()


class OneComponent(HubLoad):
    def wrench(self, hub):
        return jnp.zeros(3), jnp.ones(1)


class Masked(HubLoad):
    a: object

    def wrench(self, hub):
        return jnp.ones(3) * self.a, jnp.zeros(3)


class Knotted(HubLoad):
    knots = 1.3

    def wrench(self, hub):
        return jnp.zeros(3), jnp.zeros(3)


class OfTheSlope(Load):
    depends_on = ("r_x",)

    def force(self, time, fields, rates):
        return 0.0 * fields.r_x


HERE = r"test_own_terms.py:\d+"
"""The place in a user's file, which is this one."""

REFUSED = [
    (lambda: [OfTwo()], r"`terms\[0\] \(OfTwo\).wrench` must return a force \[N\] of shape \(3,\), but "
     r"{HERE} returns an array of shape \(2,\)"),
    (lambda: [Alone()], r".wrench` must return two things, .*, but {HERE} returns an array of shape"),
    (lambda: [Weight(jnp.array(G)), Decides()],
     r"`terms\[1\] \(Decides\).wrench` must use `jnp.where` in place of .*, but {HERE} raises"),
    (lambda: [Root()], r".wrench` must be finite, but what {HERE} returns at the start"),
    (lambda: [Root(np.inf)], r"`terms\[0\] \(Root\).a` must be finite, but is inf \(see {HERE}\)"),
    (lambda: [Misspelt()], r"use fields that exist, but {HERE} uses `positon` \(perhaps `position`\)"),
    (lambda: [Far()], r"not use fields that are None here, `heliocentric_position` \(needs \[orbit\]\)"),
    (lambda: [Product()], r"must be a function that JAX can trace, but {HERE} raises TypeError: dot"),
    (lambda: [OneVector()], r"must return forces \[N/m\] of shape \(3, 5, 1, 3\), but .* of shape \(3,\)"),
    (lambda: [OneForAll()], r"must return accelerations .* returns an array of shape \(3,\)"),
    (lambda: [Plane()], r"must return forces \[N\] of shape \(3, 3\), but .* of shape \(2, 3\)"),
    (lambda: [Total()], r"must return energies \[J/m\] of shape \(5, 1, 3\), but .* of shape \(\)"),
    (lambda: [OneComponent()], r"must return a torque .* of shape \(3,\), but .* of shape \(1,\)"),
    (lambda: [Masked(np.ma.array([1.0, 2.0, 3.0], mask=[1, 0, 0]))],
     r"`terms\[0\] \(Masked\).a` must hold no masked numbers, but has 1"),
    (lambda: [OfTheSlope()], r"`terms\[0\].depends_on` must be a tuple of \"r\" and, .* but is \('r_x',\)"),
    (Pulse, r"`terms` must be a list of terms, but is a Pulse \(write \[term\]\)"),
    (lambda: [Pulse], r"of one of the kinds .* but Pulse is the class: write its parentheses"),
    (lambda: [3.0], r"`terms\[0\]` must be of one of the kinds .* but float is of none"),
    (lambda: {"a": 1}, r"`terms` must be a list of terms, but is a dict"),
]  # fmt: skip


def test_knots_that_are_no_instants_are_refused():
    """They are asked for when the run is built."""
    with pytest.raises(esail.SceneError, match=r"\(Knotted\).knots` must be a property that gives a tuple"):
        built = build_jitted(*split(load_scene("baseline", SAIL | {"terms": [Knotted()]})))
        built.system.knots(jnp.zeros(()), built.q, built.v)


@pytest.mark.parametrize(("terms", "message"), REFUSED)
def test_wrong_terms_are_refused_in_one_line(terms, message):
    """By every door, as all of them load the scene; with the place in the user's file."""
    with pytest.raises(InputError, match=message.replace("{HERE}", HERE)) as error:
        load_scene("baseline", SAIL | {"terms": terms()})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("scene", "overrides", "term", "message"),
    [
        ("baseline", SAIL | {"hub": None}, Pulse(), r"no HubLoad without \[hub\], but Pulse is a HubLoad"),
        ("hanging-chain", {}, AxialPush(jnp.ones(())), r"must be no TipLoad with a chain"),
        ("hanging-chain", {}, Lorentz(jnp.ones(3)), r"no `commanded` with a chain, but Lorentz has it"),
        ("truss", {}, Bending(jnp.ones(())), r"not depend on the curvature without cable elements"),
        ("baseline", SAIL, Lorentz(jnp.ones(3)), r"`current` is None without `tethers.wire_radius`"),
        ("baseline", SAIL | {"terms.0": 1.0}, Pulse(), r"the numbers of terms are given as a whole"),
    ],
)  # fmt: skip
def test_terms_need_the_part_on_which_they_act(scene, overrides, term, message):
    """Also a number of a term under a key of its own is refused."""
    with pytest.raises(InputError, match=message):
        load_scene(scene, overrides | {"terms": [term]})


def test_modes_take_energies_and_dissipations_only():
    """The modes of a sail with an own energy are those of the stiffer sail; other terms are refused."""
    with pytest.raises(InputError, match=r"`terms\[0\]` must be an Energy or a Dissipation for modes"):
        esail.modes("baseline", SAIL, terms=[Pulse()])


def test_a_scene_with_terms_says_so():
    """In words, and without a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = load_scene("baseline", SAIL | {"terms": [Pulse(), Weight(jnp.array(G))]})
    assert "Pulse, Weight" in repr(scene)
    assert scene.replace({"integrator.t_end": 5.0}).terms == scene.terms
    assert load_scene(scene, {"terms": None}).terms == ()
    assert observed.listed(made({}, [Pulse()]).system)
