"""The convergence order of generalized-alpha on a soft, smooth sail."""

import numpy as np
import pytest

import esail_jax as esail
from esail_jax.scenes.structure import split
from esail_jax.steppers.consistent import consistent_acceleration
from support.quick import build_jitted, jit
from support.soft_sail import SOFT, STEPS, orders, stepped

REFERENCE = STEPS[0] / 128
"""Step of the reference [s]."""


@pytest.mark.nightly
def test_positions_reactions_and_multipliers_converge_with_second_order(validate):
    """The error falls by 2^(2.0 +- 0.1) at every halving of the step.

    The reference is a run with 1/128 of the largest step; its own error changes the last slope by 0.02. The
    stepper's multipliers are compared with those of Eq. 1-3 of [PGV] at the end of that run. The run's own
    multipliers would be a poor reference: the rounding error of the stepper's multipliers grows as the step
    becomes smaller, to 5e-8 N at this step, which is a third of the error at the smallest step compared.
    """
    runs = {h: esail.simulate("baseline", SOFT | stepped(h)) for h in (*STEPS, REFERENCE)}
    # The blocks of all runs end at the end of the run, where the multipliers are compared.
    ends = {h: run.checkpoint.motion.state for h, run in runs.items()}
    assert {float(end.time) for end in ends.values()} == {16.0}
    system = build_jitted(*split(esail.load_scene("baseline", SOFT))).system
    end = ends[REFERENCE]
    _, consistent = jit(consistent_acceleration)(system, end.time, end.now.q, end.now.v)

    signals = ("tip_position_I", "coning_angle", "angular_velocity_B", "reaction_B")
    values = {name: {h: run[name][-1] for h, run in runs.items()} for name in signals}
    multipliers = {h: np.asarray(ends[h].now.lam.hub) for h in STEPS}
    values["stepper's multipliers"] = multipliers | {REFERENCE: np.asarray(consistent.hub)}
    for number, (name, value) in enumerate(values.items()):
        errors = [np.abs(value[h] - value[REFERENCE]).max() for h in STEPS]
        found = orders(errors)
        # The hub's rate is not yet in its asymptotic range at the largest step (slope 1.87).
        distance = np.abs(found[1 if name == "angular_velocity_B" else 0 :] - 2.0).max()
        case = "order of generalized-alpha, soft sail"
        reference = "its own at h/128" if name in signals else "Eq. 1-3 at its own end, h/128"
        validate(f"ORD-{number + 1}", case, reference, f"{name}, distance from 2", distance, 0.1)
