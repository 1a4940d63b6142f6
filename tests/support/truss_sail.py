"""A run of a small sail of trusses as a function of its spin rate, for tests of derivatives."""

import esail_jax as esail

SAIL = {
    "tethers.count": 3, "tethers.elements": 1, "tethers.element": "truss", "tethers.bending": False,
    "tethers.second_moment": None, "tethers.bending_damping_time": None, "integrator.t_end": 20.0,
    "output.interval": 10.0,
}  # fmt: skip
METHODS = {
    "collocation": {},
    "generalized-alpha": {"integrator.method": "generalized-alpha", "integrator.step": 1.0},
    "energy-momentum": {"integrator.method": "energy-momentum", "integrator.step": 1.0},
}
SPIN = 4e-3


def angle(method="collocation"):
    """The last coning angle of a tether as a function of the spin rate."""

    def f(spin):
        scene = SAIL | METHODS[method] | {"initial.spin_rate": spin}
        return esail.simulate("baseline", scene)["coning_angle"][-1, 0]

    return f
