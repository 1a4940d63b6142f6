"""A gradient and a batch of gradients by every JAX supported, in a first and in a second process.

The reference numbers were computed with JAX 0.10.2. `.ci/run` repeats the test with the newest JAX."""

import json

import numpy as np
import pytest

from support.new_process import output_of

PROGRAM = """
import json, jax, jax.numpy as jnp, esail_jax as esail
small = {"tethers.count": 3, "tethers.elements": 1, "tethers.element": "truss", "tethers.bending": False,
         "integrator.t_end": 20.0, "initial.coning_angle_deg": 1.0}
coning = lambda volts: esail.simulate("baseline", {**small, "voltage.value": volts})["coning_angle"][-1, 0]
volts = jnp.array([[20e3, 21e3, 19e3], [22e3, 23e3, 21e3]])
print(json.dumps([jax.grad(coning)(volts[0]).tolist(), jax.vmap(jax.grad(coning))(volts).tolist()]))
"""

REFERENCE = np.array(
    [
        [-5.470653039755939e-09, 3.2662174998658834e-09, 3.6494135372668097e-09],
        [-5.470653316977367e-09, 3.26621586792717e-09, 3.6494153829586763e-09],
    ]
)


@pytest.mark.nightly
def test_gradient_and_its_batch_in_two_processes(tmp_path, without_jax_cache):
    """Both agree with those of JAX 0.10.2 to 1e-10 of the largest number: rounding of a run of few steps.
    The second process, which finds the programs that the first has kept, gives the same bits."""
    first, second = (output_of(PROGRAM, ESAIL_CACHE=str(tmp_path)) for _ in range(2))
    assert first == second
    gradient, batch = map(np.array, json.loads(first))
    largest = np.abs(REFERENCE).max()
    assert np.abs(batch - REFERENCE).max() < 1e-10 * largest
    assert np.abs(gradient - REFERENCE[0]).max() < 1e-10 * largest
