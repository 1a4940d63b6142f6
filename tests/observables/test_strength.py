"""The warning of tethers under more stress than they bear."""

import re

import numpy as np
import pytest

import esail_jax as esail
from esail_jax.observables.run_warning import strength_warning

SCENE = esail.load_scene("baseline", {"tethers.count": 3, "tethers.youngs_modulus": 1e11})
STRAIN = {"max_axial_strain": np.array([[1e-3, 2e-3, 1e-3], [1e-3, 4e-3, np.nan]])}


@pytest.mark.parametrize(
    ("strength", "words"),
    [
        (None, ""),
        (4.1e8, ""),
        (
            3.2e8,
            "Tether 2 is under more stress than `tethers.strength`: the least margin is -20%, of ",
        ),
        (
            [0.5e8, 3.2e8, 9e9],
            "Tethers 1, 2 are under more stress than `tethers.strength`: .* of tether 1",
        ),
    ],
)
def test_the_least_margin_is_that_of_the_largest_stress(strength, words):
    """E eps = 400 MPa in tether 2 at the second instant, 100 MPa in the others; NaN rows do not count."""
    said = strength_warning(STRAIN, SCENE.replace({"tethers.strength": strength}))
    assert re.match(words, said) if words else said == ""


def test_a_cold_tether_is_under_more_stress():
    """With an expansion of 1e-5/K, 100 K below the reference add a strain of 1e-3."""
    heat = {"thermal.expansion": 1e-5, "thermal.reference_temperature": 300.0, "thermal.temperature": 200.0}
    scene = SCENE.replace({"tethers.strength": 4.5e8} | heat)
    assert strength_warning(STRAIN, scene) == ""
    cold = STRAIN | {"temperature": np.full((2, 3), 200.0)}
    assert "least margin is -10%, of tether 2 in saved row 1" in strength_warning(cold, scene)
