"""A small sail with every law and load, for tests of symmetries."""

import equinox as eqx

from esail_jax.measurements import Measurements

P = 4
"""Number of tethers."""

SAIL = {
    "tethers.count": P, "tethers.elements": 1, "tethers.element": "truss", "tethers.bending": False,
    "tethers.second_moment": None, "tethers.bending_damping_time": None, "integrator.t_end": 300.0,
    "output.interval": 100.0, "initial.sailing_angle_deg": 30.0,
}  # fmt: skip


class Lighthouse(eqx.Module):
    """A law of a user: more voltage on tethers that come towards the wind."""

    volts: float = 2e4

    def commanded(self, measured: Measurements):
        cosine, sine = measured.root_phase
        return self.volts * (1.0 + 0.2 * sine + 0.1 * cosine * sine)


VALUES = [18e3, 20e3, 23e3, 21e3]
LAWS = {
    "constant": {"voltage.value": VALUES},
    "harmonic": {"voltage.law": "harmonic", "voltage.cosine": [0.1, 0.02], "voltage.sine": [0.1, -0.05]},
    "table": {"voltage.law": "piecewise-linear", "voltage.time": [0.0, 100.0, 150.0],
              "voltage.table": [[1.0, 0.9, 0.8, 0.7], [0.5, 0.6, 0.7, 0.9], [0.0, 1.0, 0.4, 0.2]]},
    "on-off": {"voltage.law": "on-off", "voltage.on": [10.0, 50.0, 70.0, 90.0], "voltage.rise_time": 20.0},
    "feedback": {"voltage.law": "feedback", "voltage.gain": 2.0, "voltage.target_sailing_angle_deg": 50.0},
    "momentum": {"voltage.law": "feedback", "voltage.gain": 2.0, "voltage.target_sailing_angle_deg": 50.0,
                 "voltage.measured_axis": "angular-momentum"},
    "window": {"voltage.law": "phase-window", "voltage.on_phase_deg": [10.0, 20.0, 30.0, 40.0],
               "voltage.off_phase_deg": 200.0, "voltage.rise_phase_deg": 15.0},
    "python": {"voltage_law": Lighthouse(), "voltage.value": None},
}  # fmt: skip
LOADS = {
    "tangential": {"tip_thrust.force": [1e-3, 2e-3, 1e-3, 3e-3], "tip_thrust.direction": "tangential"},
    "radial": {"tip_thrust.force": [1e-3, 2e-3, 1e-3, 3e-3], "tip_thrust.direction": "radial"},
    "units": {"remote_units.mass": [1.0, 1.5, 2.0, 2.5], "solar_wind.relative": True},
    "release": {"event.time": [100.0], "event.release": [2]},
}  # fmt: skip
CASES = LAWS | LOADS
