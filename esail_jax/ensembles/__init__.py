"""Ensembles: one scene simulated for many sets of numbers, and the statistics of the results.

from esail_jax.ensembles import Normal, simulate_members, spread
lengths = {"tethers.length": Normal(10e3, 10, per_tether=True)}
ensemble = simulate_members("baseline", vary=lengths, members=64, seed=1)
ensemble = run_ensemble("baseline", "many", vary=lengths, members=10_000, seed=1)  # on all cores, to a file
spread(ensemble, "coning_angle").quantiles
"""

from esail_jax.ensembles.distributions import Distribution, Grid, LogNormal, Normal, Uniform
from esail_jax.ensembles.ensemble import Ensemble
from esail_jax.ensembles.ensemble_file import load_ensemble
from esail_jax.ensembles.gradient import MeanGradient, mean_gradient
from esail_jax.ensembles.joining import join
from esail_jax.ensembles.member_runner import MemberRunner
from esail_jax.ensembles.members import simulate_members
from esail_jax.ensembles.reductions import REDUCTIONS
from esail_jax.ensembles.running import run_ensemble
from esail_jax.ensembles.sampling import (
    Inputs,
    Variation,
    VariationError,
    draw,
    parse_variation,
    select_members,
)
from esail_jax.ensembles.statistics import (
    OUTCOMES,
    Outcome,
    Sensitivities,
    Spread,
    outcomes_of,
    sensitivities,
    spread,
)

__all__ = [
    "OUTCOMES",
    "REDUCTIONS",
    "Distribution",
    "Ensemble",
    "Grid",
    "Inputs",
    "LogNormal",
    "MeanGradient",
    "MemberRunner",
    "Normal",
    "Outcome",
    "Sensitivities",
    "Spread",
    "Uniform",
    "Variation",
    "VariationError",
    "draw",
    "join",
    "load_ensemble",
    "mean_gradient",
    "outcomes_of",
    "parse_variation",
    "run_ensemble",
    "select_members",
    "sensitivities",
    "simulate_members",
    "spread",
]
