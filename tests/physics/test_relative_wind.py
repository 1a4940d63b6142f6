"""The wind relative to each point of a tether (`solar_wind.relative`): the decay of the spin."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.environment.solar_wind import SteadyWind
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.loads.voltage import Constant
from esail_jax.scenes.structure import split
from esail_jax.steppers.transposable import Transposable
from support.one_tether import STEPPERS, integrate, one_tether, straight, turning
from support.quick import build_jitted, jit, quickly

ROD, TIP, LENGTH = 0.6, 1.5, 2.0
"""Masses of rod and tip [kg], length [m]."""


@pytest.mark.parametrize("stepper", quickly(STEPPERS, ("collocation",)))
def test_spin_of_a_straight_tether_decays(stepper, validate):
    """The angular momentum of a straight tether about an axis along the wind through its root decays as
    exp(-k t), k = sigma L / (3 u (m_u + rho A L/3)).

    Derivation: the moment of f = (sigma/u) (w - (w . i_t) i_t), w = u - dr/dt, about the root is
    (sigma/u) r x w, because what is left out of w is along the tether, and r is too. With r = (x/L) r_tip,
    and u and the root's heliocentric position along the axis, the moment about the axis is
    -(sigma/u) (L/3) (r_tip x r_tip')_x. The angular momentum is (m_u + rho A L/3) (r_tip x r_tip')_x. No
    angle is assumed to be small: the wind also drives the tether out of the spin plane, and stretches it.
    Accepted is (omega h)^2 = 1.7e-4, the error of methods of second order, and 1e-8 for collocation, whose
    tolerance is 1e-11.
    """
    drag, speed, spin, axis = 0.3, 1.0, 1.3, jnp.array([1e3, 0.0, 0.0])
    wind = SteadyWind(jnp.asarray(speed), jnp.asarray(1e6), jnp.zeros(()), axis)
    volts = jnp.full(1, drag / wind.thrust_per_speed(jnp.ones(())))
    load = CoulombThrust.of(wind, Constant(volts), 1, relative=True)
    made = one_tether(
        kind="truss", elements=1, length=LENGTH, axial=1e5, line_density=ROD / LENGTH, tip_mass=TIP,
        loads=(load,),
    )  # fmt: skip
    q = straight(made)
    time, q, v, _ = integrate(stepper, made, q, turning(q, [spin, 0.0, 0.0]), 0.01, 400)
    r, rate = q.tether[:, 0, :, -1, 0], v.tether[:, 0, :, -1, 0]
    momentum = np.cross(r, rate)[:, 0]
    k = drag * LENGTH / (3.0 * (TIP + ROD / 3.0))
    error = np.abs(momentum / momentum[0] - np.exp(-k * time)).max()
    accepted = 1e-8 if stepper == "collocation" else (0.01 * spin) ** 2
    assert np.abs(r[:, 0]).max() > 0.1 and momentum[-1] < 0.7 * momentum[0]
    validate(
        f"REL-1 {stepper}", "straight tether in its relative wind", "closed form: exp(-k t)",
        "decay of the angular momentum by 38 %", error, accepted,
    )  # fmt: skip


SMALL = {"tethers.count": 3, "tethers.elements": 2, "initial.sailing_angle_deg": 0.0}


@pytest.fixture(scope="module")
def model():
    return build_jitted(*split(esail.load_scene("baseline", SMALL | {"solar_wind.relative": True})))


def test_torque_on_a_sail_at_the_start(model):
    """The moment of the thrust about the spin axis at the start is -(sigma/u) omega p ((R + L)^3 - R^3)/3.

    The tethers are straight, turn rigidly with the hub, and are stretched by about 1e-3 of their length,
    which changes the moment by three times that; a wind that is not relative has no such moment.
    """

    @jit
    def moment(system, q, v):
        fields, rates = system.tethers.interpolate_motion(q.tether, v.tether)
        (load,) = system.loads
        force = load.force(jnp.zeros(()), fields, rates)
        torque = jnp.cross(fields.r, force, axis=0)
        return jnp.stack([system.integrate(x) for x in torque]) @ system.rotation(jnp.zeros(()), q)[:, 0]

    system, wind = model.system, model.system.loads[0].wind
    drag = float(wind.thrust_per_speed(jnp.asarray(20e3)))
    exact = -drag * 4e-3 * 3 * ((1.0 + 10e3) ** 3 - 1.0) / 3.0
    assert moment(*model[:3]) == pytest.approx(exact, rel=5e-3)
    still = dataclasses.replace(system.loads[0], relative=False)
    assert abs(moment(dataclasses.replace(system, loads=(still,)), *model[1:3])) < 1e-6 * abs(exact)


def test_transpose_knows_the_rates(model):
    """The hand-written transpose of the forces' derivative by velocities is that of automatic
    differentiation, to rounding; without damping only the relative wind depends on velocities."""
    random, time = np.random.default_rng(5), jnp.zeros(())
    q, v, w = (jax.tree.map(lambda x: x + random.normal(size=x.shape), model.q) for _ in range(3))

    def work(v, system):
        residual, _ = system.residual(time, q, v, v, system.no_multipliers())
        return sum(jax.tree.leaves(jax.tree.map(lambda f, w: (f * w).sum(), residual.forces, w)))

    system = dataclasses.replace(model.system, dissipations=())
    slopes = jit(lambda system: [jax.grad(work)(v, x) for x in (system, Transposable.of(system))])
    plain, turned = slopes(system)
    inertia, _ = slopes(dataclasses.replace(system, loads=()))
    for x, y in zip(*map(jax.tree.leaves, (plain, turned)), strict=True):
        assert np.allclose(x, y, rtol=0, atol=1e-12 * np.abs(x).max())
    assert np.abs(plain.tether - inertia.tether).max() > 0.0


def test_not_with_the_axes_of_an_orbit(nothing_compiles):
    """Velocities in the turning axes of an orbit are not those in inertial axes."""
    wind = {"solar_wind.speed": 4e5, "solar_wind.number_density": 7e6, "solar_wind.cutoff_voltage": 1e3}
    wind |= {"voltage.value": 1e4, "initial.heliocentric_position_au": [1.0, 0.0, 0.0]}
    scene = esail.Scene(
        chain=esail.Chain(rods=2, mass=0.1, length=1.0, area=1e-6, youngs_modulus=1e9),
        initial=esail.ChainInitial(rod_vector=[0, -1, 0]),
        orbit=esail.Orbit(1e-3),
        integrator=esail.Integrator(t_end=1.0),
    ).replace(wind)
    with pytest.raises(esail.SceneError, match=r"`solar_wind.relative` must be false with \[orbit\]"):
        scene.replace({"solar_wind.relative": True})
    with pytest.raises(esail.SceneError, match=r"`solar_wind.relative` must be true or false"):
        scene.replace({"solar_wind.relative": 1.0})
