"""A part that a scene leaves out is not there: fewer equations, and not among the terms."""

import dataclasses
import importlib.util
from pathlib import Path

import pytest

import esail_jax as esail
from esail_jax.scenes.build import build_jitted
from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.structure import split
from esail_jax.simulation.entry import problem_of

SCRIPT = Path(__file__).parents[1] / "experiments" / "performance" / "run.py"


@pytest.fixture(scope="module")
def performance():
    """The script that also measures times."""
    specification = importlib.util.spec_from_file_location("performance", SCRIPT)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


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


def test_an_absent_part_leaves_no_equations(performance):
    """Equations of a step, strictly fewer without bending, damping, voltage or hub; a voltage of
    zero, in contrast, is a term like any other."""

    def measured(scene):
        structure, numbers = split(with_method(scene))
        problem, carry = problem_of(numbers, build_jitted(structure, numbers))
        return performance.equations_of_a_step(problem, carry.state), problem.system.terms

    full, lacking = scenes()
    equations, terms = measured(full)
    for part, scene in lacking.items():
        fewer, left = measured(scene)
        assert fewer < equations, part
        assert any(part in term for term in terms) and not any(part in term for term in left)
    assert measured(full.replace({"voltage.value": 0.0})) == (equations, terms)
