"""A sail that has every part that one scene can have, and a state of it in which every number matters."""

import jax
import jax.numpy as jnp
import numpy as np

import esail_jax as esail
from esail_jax.scenes.build import build
from esail_jax.scenes.build_parts import origin_of
from esail_jax.scenes.structure import split
from esail_jax.simulation.look import look
from esail_jax.simulation.problem import Problem
from esail_jax.steppers.consistent import consistent_motion
from esail_jax.steppers.stepper import Point
from esail_jax.system import Power
from support.derivatives import pattern
from support.near_sun import NEAR_SUN
from support.ring_sail import EACH, RING_NUMBERS, TRUSSES, ring_scene

PARTS = {
    "orbit.position_au": NEAR_SUN["orbit.position_au"],
    "orbit.velocity": NEAR_SUN["orbit.velocity"],
    "solar_wind.reference_distance_au": 0.01,
    "solar_wind.relative": True,
    "solar_wind.thrust_law": "debye-sheath",
    "solar_wind.electron_temperature_ev": 12.0,
    "solar_wind.tether_radius": 1e-5,
    "solar_wind.cutoff_voltage": None,
    "tethers.wire_radius": 12.5e-6,
    "tethers.wires": 4,
    "thermal.expansion": 2.3e-5,
    "thermal.reference_temperature": 300.0,
    "thermal.temperature": [[350.0, 330.0, 320.0, 310.0, 340.0], [250.0, 280.0, 290.0, 270.0, 260.0],
                            [300.0, 320.0, 310.0, 290.0, 300.0]],
    "thermal.time": [1.0, 3.0, 4.0],
    "initial.coning_angle_deg": 5.0,
}  # fmt: skip
PUSHED = {
    "tip_thrust.force": 2e-3,
    "tip_thrust.on": 1.0,
    "tip_thrust.off": 3.0,
    "tip_thrust.rise_time": 0.8,
    "voltage.power_limit": 0.3,
    "hub.torque": [1e-3, -2e-3, 3e-3],
}
"""Thrust at the tips, a torque on the hub, and less power than the voltages of the scene need."""

SCENE = esail.load_scene(ring_scene(TRUSSES | PARTS), PUSHED)
"""Five unequal tethers and a ring of unequal segments that may become slack, near the Sun."""

INSTANTS = (0.0, 1.3, 2.2, 3.4)
"""Instants [s] at which the temperatures and the thrust at the tips are in different parts of their
course."""

ROWS = np.linspace(1.0, -0.5, 15).reshape(3, 5)

NUMBERS = {key: (value + 0.0 * EACH, size * EACH) for key, (value, size) in RING_NUMBERS.items()} | {
    "thermal.expansion": (2.3e-5, 1e-7),
    "thermal.reference_temperature": (300.0, 1.0),
    "thermal.temperature": (np.array(PARTS["thermal.temperature"]), ROWS),
    "thermal.time": (np.array(PARTS["thermal.time"]), np.array([4e-3, -3e-3, 2e-3])),
    "orbit.position_au": (np.array(NEAR_SUN["orbit.position_au"]), np.array([1e-5, -5e-6, 1e-5])),
    "orbit.velocity": (np.array(NEAR_SUN["orbit.velocity"]), np.array([1e3, -5e2, 1e3])),
    "solar_wind.reference_distance_au": (0.01, 1e-5),
    "solar_wind.electron_temperature_ev": (12.0, 0.02),
    "solar_wind.tether_radius": (1e-5, 2e-8),
    "tethers.wire_radius": (12.5e-6, 2e-8),
    "voltage.power_limit": (0.3, 1e-3),
    "hub.torque": (np.array([1e-3, -2e-3, 3e-3]), np.array([1e-5, -2e-5, 1e-5])),
    "tip_thrust.force": (2e-3, 2e-5),
    "tip_thrust.on": (1.0, 2e-3),
    "tip_thrust.off": (3.0, 2e-3),
    "tip_thrust.rise_time": (0.8, 2e-3),
}
"""Numbers by scene key, and their changes in a difference quotient."""

NAMES = ("auxiliary_tension", "thrust_O", "reaction_O", "voltage", "electric_power", "elastic_energy",
         "max_axial_strain", "heliocentric_velocity", "external_power", "dissipated_power")  # fmt: skip


def signals_of_model(numbers):
    """The steady start of the scene with the numbers, and at every instant of INSTANTS the accelerations,
    multipliers and observables of a state near this start, in which everything moves."""
    structure, given = split(esail.load_scene(SCENE, numbers))
    system, q, v, _ = build(structure, given)
    zero = jnp.zeros(())
    problem = Problem(system, None, origin_of(given), zero, None, None, system.kepler_orbit)

    def shaken(x, size):
        """Coordinates with another change in every component."""
        return x.axpy(size, jax.tree.map(lambda leaf: jnp.asarray(pattern(leaf.shape)), x))

    def at(time):
        nothing, moving = Power(zero, zero), (shaken(q, 1e-3), shaken(v, 1e-3))
        rows, point, _ = look(problem, Point(time, *moving, nothing, jnp.asarray(False)), NAMES)
        motion = consistent_motion(system, time, point.q, point.v)
        moves = {f"acceleration {i}": x for i, x in enumerate(jax.tree.leaves(motion.vdot))}
        return rows | moves | {f"multiplier {i}": x for i, x in enumerate(jax.tree.leaves(motion.lam))}

    begin = {f"start {i}": x for i, x in enumerate(jax.tree.leaves((q, v)))}
    return begin | jax.vmap(at)(jnp.array(INSTANTS))
