"""The fixture `nothing_compiles` (`support/compiled_nothing.py`) notices every kind of compilation."""

from concurrent.futures import ThreadPoolExecutor

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from support.compiled_nothing import no_compilation
from support.quick import quickly

pytestmark = pytest.mark.drops_programs

SAIL = {"tethers.count": 3, "tethers.elements": 2, "integrator.t_end": 1.0}
RUNS = {
    "rods": ("hanging-chain", {"chain.rods": 3, "integrator.method": "dopri8", "integrator.t_end": 0.01}),
    "collocation": ("baseline", SAIL | {"integrator.tolerance": 1e-6}),
    "generalized-alpha": ("baseline", SAIL | {"integrator.method": "generalized-alpha"}),
}


@pytest.mark.parametrize("method", quickly(RUNS))
def test_a_run_of_every_kind_of_method_is_noticed(method):
    name, settings = RUNS[method]
    with pytest.raises(AssertionError, match="was compiled"), no_compilation():
        esail.simulate(name, settings)


def test_programs_are_noticed_however_they_are_compiled():
    """The fixture notices a program of `jax.jit` that was compiled before, a program that a thread compiles
    ahead of time, and a program whose error is caught."""
    double = jax.jit(lambda x: 2.0 * x)
    double(jnp.ones(3))
    with pytest.raises(AssertionError, match="was compiled"), no_compilation():
        double(np.ones(3))
    lowered = jax.jit(lambda x: 3.0 * x).lower(np.ones(3))
    with pytest.raises(AssertionError, match="was compiled"), no_compilation():
        with ThreadPoolExecutor() as pool:
            pool.submit(lowered.compile).result()
    with pytest.raises(AssertionError, match="compiled"), no_compilation():
        try:
            double(np.ones(3))
        except AssertionError:
            pass


def test_numbers_become_arrays_unnoticed():
    with no_compilation():
        jnp.asarray([1.0, 2.0], float)
