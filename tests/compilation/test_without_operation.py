"""Runs inside functions that JAX traces, with the operation of `kept_programs` and without it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.compilation.kept import KEEPER
from support.quick import quickly
from support.truss_sail import SAIL

AT = jnp.asarray([20e3, 19e3, 21e3])
BATCH = jnp.stack([AT, 0.9 * AT])


def angle(volts):
    """The last coning angle; with fixed steps it does not depend on rounding of their ends."""
    fixed = {"integrator.method": "generalized-alpha", "integrator.step": 1.0, "integrator.t_end": 20.0}
    run = esail.simulate("baseline", SAIL | fixed | {"integrator.tolerance": None, "voltage.value": volts})
    return run["coning_angle"][-1, 0]


TRANSFORMED = {
    "run": lambda: angle(AT),
    "run in jax.jit": lambda: jax.jit(angle)(AT),
    "run in esail.jit": lambda: esail.jit(angle)(AT),
    "gradient": lambda: jax.grad(angle)(AT),
    "Hessian": lambda: jax.hessian(angle)(AT),
    "gradient of a batch": lambda: jax.grad(lambda v: jax.vmap(lambda s: angle(s * v))(BATCH / AT).mean())(
        AT
    ),
}


@pytest.mark.parametrize("name", quickly(TRANSFORMED, ["run in jax.jit"]))
def test_results_do_not_depend_on_the_operation(name, monkeypatch):
    """With `ESAIL_PRIMITIVE=off` everything goes through `jax.jit`: the same numbers, but for the order in
    which the compiler sums."""
    found = TRANSFORMED[name]()
    monkeypatch.setenv(KEEPER.switch, "off")
    monkeypatch.setattr("kept_programs.operation.bind", lambda *_, **__: pytest.fail("an operation"))
    np.testing.assert_allclose(TRANSFORMED[name](), found, rtol=1e-10, atol=1e-10 * np.abs(found).max())
