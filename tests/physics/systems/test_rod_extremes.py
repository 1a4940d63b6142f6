"""Rod chains that are slack, become taut, are stiff or at rest, or have steps that are too long."""

import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from support.quick import jit
from support.rod_tips import STEEL_TIP, tip

HARD = {
    "slack": {"gravity.acceleration": [-9.81, 0.0, 0.0], "chain.slack_strain": 1e-4},
    "snap taut": {
        "initial.rod_vector": [0.0, -0.9, 0.0], "initial.rod_rate": [0.1, -5.0, 0.0],
        "chain.slack_strain": 1e-4,
    },
    "stiffness ratio": {"chain.youngs_modulus": [1e9, 1e3, 1e9, 1e9, 1e6]},
    "mass ratio": {"chain.mass": [0.1, 1e-5, 0.1, 10.0, 0.1]},
}  # fmt: skip


IMPLICIT = {"slack": 5e-3, "snap taut": 0.3, "stiffness ratio": 3e-2, "mass ratio": 3e-2}
"""Fraction of the energy that generalized-alpha may lose or gain at 1e-3 s. It damps the vibration of rods
that become taut, which holds most of the energy there, and resolves the other motion to second order."""


@pytest.mark.nightly
@pytest.mark.parametrize("case", HARD)
def test_hard_cases_end_well(case):
    """Explicit methods keep the energy; the implicit method loses a known part and gains almost nothing."""
    settings = {"chain.rods": 5, "integrator.t_end": 2.0, "output.interval": 0.02} | HARD[case]
    run = esail.simulate("hanging-chain", settings)
    assert np.abs(run["energy_error"]).max() < 1e-6
    if case == "snap taut":
        assert run["tension"].min() == 0.0 and run["tension"].max() > 10.0
    method = {"integrator.method": "generalized-alpha", "integrator.step": 1e-3}
    error = esail.simulate("hanging-chain", settings | method)["energy_error"]
    assert error.max() < 5e-3 and error.min() > -IMPLICIT[case], (error.min(), error.max())


@pytest.mark.nightly
@pytest.mark.parametrize("step, words", [(1e-4, "infinite or undefined"), (1e-5, "energy balance")])
def test_an_explicit_step_that_is_too_long_says_so(step, words):
    """A step with omega h = 18 overflows; with 1.8 the chain vibrates, which its energy balance shows."""
    settings = {"integrator.step": step, "integrator.method": "dopri5", "integrator.t_end": 0.5}
    with pytest.raises(esail.SimulationError, match=f"{words}.*too long for the fastest"):
        esail.simulate("steel-chain", settings)
    lost = jit(
        lambda g: esail.simulate("steel-chain", settings | {"gravity.acceleration": g})
    )(jnp.array([9.81, 0.0, 0.0]))  # fmt: skip
    assert lost.result != esail.RESULTS.successful
    assert np.isnan(lost["tension"][-1]).all() and np.isfinite(lost["tension"][0]).all()


@pytest.mark.nightly
def test_the_implicit_method_resolves_the_stretch_of_steel():
    """The error is of second order down to 1e-6 m; rods stretch by 2e-7 m."""
    errors = []
    for step in (1e-4, 5e-5):
        settings = {
            "integrator.method": "generalized-alpha", "integrator.step": step,
            "integrator.spectral_radius": 0.9, "output.interval": 0.5,
        }  # fmt: skip
        errors.append(np.abs(tip(esail.simulate("steel-chain", settings))[-1] - STEEL_TIP).max())
    assert errors[0] / errors[1] > 3.0 and errors[1] < 2e-6, errors


def test_the_chosen_method_depends_on_the_stiffness_and_on_the_step():
    """The explicit method is chosen while its steps are affordable, unless a given step is too long for
    it."""
    from esail_jax.scenes.method_choice import with_method

    def chosen(**settings):
        overrides = {key.replace("__", "."): value for key, value in settings.items()}
        return with_method(esail.load_scene("steel-chain", overrides)).integrator

    assert (chosen().method, chosen().tolerance, chosen().step) == ("dopri8", 1e-9, None)
    assert chosen(integrator__t_end=100.0).method == "dopri8"
    stiff = chosen(chain__youngs_modulus=207e15, integrator__t_end=100.0, output__interval=1.0)
    assert stiff.method == "generalized-alpha"
    np.testing.assert_allclose(stiff.step, 1e-3 * np.sqrt(0.1 / 9.81), rtol=1e-12)
    assert chosen(integrator__step=1e-6).method == "dopri8"
    assert chosen(integrator__step=1e-4).method == "generalized-alpha"
    assert chosen(integrator__tolerance=1e-5).tolerance == 1e-5


@pytest.mark.nightly
def test_the_implicit_method_chosen_for_a_stiff_chain_runs():
    """The implicit method integrates a stiff chain for which an explicit method needs 1.1e7 steps.

    Rods at the free end rotate by a hundred radians per second; the step resolves this or is halved.
    """
    settings = {
        "chain.youngs_modulus": 207e14, "integrator.t_end": 0.7, "output.interval": 0.1,
        "gravity.acceleration": [0.0, 0.0, 9.81],
    }  # fmt: skip
    run = esail.simulate("steel-chain", settings)
    assert run.stats["terms"] and 6000 < run.steps < 40_000, "generalized-alpha"
    assert np.abs(run["energy_error"]).max() < 1e-3


@pytest.mark.nightly
@pytest.mark.parametrize("anchor", ["fixed", "free"])
def test_a_chain_at_rest_stays_there(anchor):
    """A chain at rest stays at rest. Its energy is rounding, so that no relative error is formed."""
    settings = {
        "gravity.acceleration": [0.0, 0.0, 0.0], "initial.rod_rate": [0.0, 0.0, 0.0],
        "chain.anchor": anchor,
        "initial.rod_vector": [1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0], "output.interval": 1.0,
    }  # fmt: skip
    run = esail.simulate("hanging-chain", settings)
    np.testing.assert_allclose(tip(run), np.tile(tip(run)[:1], (6, 1)), atol=1e-12)
