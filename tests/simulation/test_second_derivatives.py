"""Second derivatives of runs, and derivatives of batches, are those of difference quotients."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.errors import SimulationError
from support.quick import jit, quickly

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


def angle(method):
    """The last coning angle of a tether as a function of the spin rate."""

    def f(spin):
        scene = SAIL | METHODS[method] | {"initial.spin_rate": spin}
        return esail.simulate("baseline", scene)["coning_angle"][-1, 0]

    return f


def quotient(f):
    """The derivative of a function of the spin rate, of fourth order."""
    h = 4e-5
    y = np.array([float(f(SPIN + k * h)) for k in (-2, -1, 1, 2)])
    return (y[0] - 8 * y[1] + 8 * y[2] - y[3]) / (12 * h)


@pytest.mark.nightly
@pytest.mark.parametrize("method", METHODS)
def test_second_derivatives_of_a_run(method):
    """Forward over forward, forward over reverse and reverse over forward mode agree with each other to
    1e-8, and with the quotient of first derivatives to 1e-6. These agree with the quotient of runs."""
    f = angle(method)
    pairs = {
        "jvp of jvp": jax.jacfwd(jax.jacfwd(f)),
        "jvp of grad": jax.jacfwd(jax.grad(f)),
        "grad of jvp": jax.grad(jax.jacfwd(f)),
    }
    found = {name: float(jit(second)(SPIN)) for name, second in pairs.items()}
    slope = jit(jax.jacfwd(f))
    assert float(slope(SPIN)) == pytest.approx(quotient(f), rel=1e-6)
    assert found["jvp of jvp"] == pytest.approx(quotient(slope), rel=1e-6)
    for name, x in found.items():
        assert x == pytest.approx(found["jvp of jvp"], rel=1e-8), name
