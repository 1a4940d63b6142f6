"""A soft sail on which the convergence orders of methods with fixed steps are measured."""

import numpy as np

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
"""With EA = 0.2 N the fastest axial and transverse modes stay below 1 rad/s, so that every step size
resolves all modes. Strong, unequal voltages and damping make every term matter."""

STEPS = (0.2, 0.1, 0.05, 0.025, 0.0125)


def stepped(h):
    """Overrides for a step size. Saved instants are 80 steps apart, so that all step sizes share
    programs."""
    return {"integrator.step": h, "output.interval": 80 * h}


def orders(errors):
    """The order of convergence between successive halvings of the step."""
    return np.log2(np.array(errors[:-1]) / errors[1:])
