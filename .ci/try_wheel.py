"""Tries an installed package: a run, and its gradient against a difference quotient."""

import jax

import esail_jax as esail

SMALL = {
    "tethers.count": 3, "tethers.elements": 1, "tethers.element": "truss", "tethers.bending": False,
    "tethers.second_moment": None, "tethers.bending_damping_time": None, "integrator.t_end": 20.0,
    "integrator.method": "generalized-alpha", "integrator.step": 1.0,
}  # fmt: skip


def angle(spin):
    """The last coning angle by the spin rate; with fixed steps it is smooth."""
    return esail.simulate("baseline", SMALL | {"initial.spin_rate": spin})["coning_angle"][-1, 0]


slope = float(jax.grad(angle)(4e-3))
quotient = float(angle(4.001e-3) - angle(3.999e-3)) / 2e-6
print(f"esail_jax {esail.__version__} at {esail.__file__}: gradient {slope:.9g}, quotient {quotient:.9g}")
assert abs(slope / quotient - 1.0) < 1e-5
