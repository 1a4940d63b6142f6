"""The convergence order of generalized-alpha on a soft, smooth sail."""

import numpy as np
import pytest

import esail_jax as esail
from support.soft_sail import SOFT, STEPS, orders, stepped


@pytest.mark.slow
def test_positions_reactions_and_multipliers_converge_with_second_order(validate):
    """The error falls by 2^(2.0 +- 0.1) at every halving of the step.

    The reference is a run with 1/64 of the largest step; its own error changes the last slope by 0.02.
    """
    runs = {h: esail.simulate("baseline", SOFT | stepped(h)) for h in (*STEPS, 0.2 / 64)}
    exact = runs.pop(0.2 / 64)
    signals = {
        "tip": lambda s: s["tip_position_I"][-1],
        "coning": lambda s: s["coning_angle"][-1],
        "hub rate": lambda s: s["angular_velocity_B"][-1],
        "reaction": lambda s: s["reaction_B"][-1],
        "stepper's multipliers": lambda s: np.asarray(s.checkpoint.motion.state.now.lam.hub),
    }
    # The blocks of all runs end at the end of the run, where the multipliers are compared.
    assert {float(run.checkpoint.motion.state.time) for run in (*runs.values(), exact)} == {16.0}
    for number, (name, signal) in enumerate(signals.items()):
        errors = [np.abs(signal(runs[h]) - signal(exact)).max() for h in STEPS]
        found = orders(errors)
        # The hub's rate is not yet in its asymptotic range at the largest step (slope 1.87).
        distance = np.abs(found[1 if name == "hub rate" else 0 :] - 2.0).max()
        case = "order of generalized-alpha, soft sail"
        validate(f"ORD-{number + 1}", case, "its own at h/64", f"{name}, distance from 2", distance, 0.1)
