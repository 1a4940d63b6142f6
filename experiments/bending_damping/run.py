"""Prints the README's table: the effect of the regularised bending dissipation.

python experiments/bending_damping/run.py
"""

import numpy as np

import esail_jax as esail

STIFF = {
    "tethers.count": 2,
    "tethers.length": 300.0,
    "tethers.elements": 4,
    "tethers.second_moment": 200.0 / 70e9,
    "tethers.root": "clamped",
    "tethers.axial_damping_time": 0.0,
    "remote_units.mass": 0.3,
    "hub.density": 200.0,
    "initial.spin_rate": 0.05,
    "initial.sailing_angle_deg": 20.0,
    "integrator.step": 0.02,
    "integrator.t_end": 120.0,
    "output.interval": 1.0,
}
"""A sail with EI = 200 N m^2: bending is significant at the root, and its damping has a visible effect."""


def run(overrides: dict, turn: float):
    """Simulates the baseline with another kappa_0 L [rad]."""
    return esail.simulate("baseline", overrides | {"tethers.straight_turn": turn})


def main() -> None:
    """Runs all values of kappa_0 L and prints the table."""
    print(
        "kappa_0 L [rad]  dissipated [J]  change of the tips [m]   largest change of direction: ",
        end="",
    )
    reference = run(STIFF, 1e-7)
    slope = reference["coning_angle"] - reference["root_coning_angle"]
    print(f"{np.abs(slope).max():.1e} rad between root and tip")
    for turn in (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6):
        found = run(STIFF, turn)
        moved = np.abs(found["tip_position_I"] - reference["tip_position_I"]).max()
        print(f"{turn:15.0e}  {found['dissipated_energy'][-1]:14.6e}  {moved:.2e}")
    print(f"{1e-7:15.0e}  {reference['dissipated_energy'][-1]:14.6e}  (reference)")
    baseline = {"integrator.t_end": 1570.8, "tethers.axial_damping_time": 0.0}
    damped = run(baseline, 1e-4)
    print(f"baseline, one period, bending damping alone: {damped['dissipated_energy'][-1]:.2e} J")


if __name__ == "__main__":
    main()
