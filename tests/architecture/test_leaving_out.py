"""A part that a scene leaves out is not in its programs: they have fewer equations and fewer terms."""

import dataclasses

import jax
import jax.numpy as jnp
import pytest

import esail_jax as esail
from esail_jax.compilation.size import count_equations
from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.structure import split
from esail_jax.simulation.problem import start
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
from support.quick import jit


def equations_of_a_step(stepper, system, state):
    """The number of equations of one factorisation and one step."""

    def step(stepper, system, state):
        factors = stepper.factor(system, jnp.zeros(()), state.q, state.v, state.lam)
        return stepper.step(system, jnp.zeros(()), state, factors, jnp.asarray(jnp.inf))

    return count_equations(jax.make_jaxpr(step)(stepper, system, state))


def scenes():
    size = {"tethers.count": 3, "tethers.elements": 2}
    full = esail.load_scene("baseline", size | {"integrator.method": "generalized-alpha"})
    undamped = dataclasses.replace(full.tethers, axial_damping_time=None, bending_damping_time=None)
    return full, {
        "bending": full.replace({"tethers.bending": False}),
        "damping": dataclasses.replace(full, tethers=undamped),
        "coulomb": dataclasses.replace(full, voltage=None, solar_wind=None),
        "hub": dataclasses.replace(full, hub=None),
    }


@pytest.mark.nightly
def test_an_absent_part_leaves_no_equations():
    """A step has fewer equations without bending, damping, voltage or hub; a voltage of zero changes
    nothing."""

    def measured(scene):
        begun = jit(start, static_argnums=0)(*split(with_method(scene)))
        problem, state = begun.problem, begun.motion.state.now
        assert isinstance(problem.stepper, GeneralizedAlpha)
        return equations_of_a_step(problem.stepper, problem.system, state), problem.terms

    full, lacking = scenes()
    equations, terms = measured(full)
    for part, scene in lacking.items():
        fewer, left = measured(scene)
        assert fewer < equations, part
        assert any(part in term for term in terms) and not any(part in term for term in left)
    assert measured(full.replace({"voltage.value": 0.0})) == (equations, terms)
