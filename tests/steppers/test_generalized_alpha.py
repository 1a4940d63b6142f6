"""Order of the stepper on a soft, smooth sail, by five halvings of the step."""

import numpy as np
import pytest

import esail_jax as esail

SOFT = {
    "tethers.count": 2,
    "tethers.elements": 2,
    "tethers.length": 1000.0,
    "tethers.youngs_modulus": 5e7,
    "tethers.axial_damping_time": [0.3, 0.4],
    "tethers.bending": False,
    "remote_units.mass": 0.5,
    "hub.density": 20.0,
    "voltage.value": [2e6, 1e6],
    "initial.spin_rate": 0.01,
    "initial.coning_angle_deg": 5.0,
    "integrator.t_end": 16.0,
}
"""EA = 0.2 N: the fastest axial and transverse modes stay below 1 rad/s, so that every step size
used resolves all of them; strong unequal voltages and damping keep every term alive."""

STEPS = (0.2, 0.1, 0.05, 0.025, 0.0125)


def stepped(h):
    """A step, and saved instants 80 steps apart, the last at the end: one program for all of them."""
    return {"integrator.step": h, "output.interval": 80 * h}


def orders(errors):
    return np.log2(np.array(errors[:-1]) / errors[1:])


@pytest.mark.slow
def test_positions_reactions_and_multipliers_converge_with_second_order(validate):
    """Error against h = 1/64 of the largest step falls by 2^(2.0 +- 0.1) at every halving
    (the reference's own error bends the last slope by 0.02)."""
    runs = {h: esail.simulate("baseline", SOFT | stepped(h)) for h in (*STEPS, 0.2 / 64)}
    exact = runs.pop(0.2 / 64)
    signals = {
        "tip": lambda s: s["tip_position_I"][-1],
        "coning": lambda s: s["coning_angle"][-1],
        "hub rate": lambda s: s["angular_velocity_B"][-1],
        "reaction": lambda s: s["reaction_B"][-1],
        "stepper's multipliers": lambda s: np.asarray(s.final_state.lam.hub),
    }
    for number, (name, signal) in enumerate(signals.items()):
        errors = [np.abs(signal(runs[h]) - signal(exact)).max() for h in STEPS]
        found = orders(errors)
        # The hub's rate is still on its way to its slope at the largest step (1.87).
        distance = np.abs(found[1 if name == "hub rate" else 0 :] - 2.0).max()
        case = "order of generalized-alpha, soft sail"
        validate(f"ORD-{number + 1}", case, "its own at h/64", f"{name}, distance from 2", distance, 0.1)
