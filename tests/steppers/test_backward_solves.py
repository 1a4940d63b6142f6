"""The iterations for the linear equations of a derivative by collocation."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax.steppers.collocation_solution import MAX_LINEAR_ITERATIONS, StageUnknowns, improved

RANDOM = np.random.default_rng(0)
COUPLING = RANDOM.normal(size=(6, 6))
COUPLING /= np.abs(np.linalg.eigvals(COUPLING)).max()
ALSO = RANDOM.normal(size=(2, 6))
RHS = RANDOM.normal(size=6)


def solution(rate, rhs):
    """B x and x of (1 + `rate` C) x = rhs, and the number of iterations, which use the solution of
    x = rhs."""
    count = 0

    def counted(_):
        nonlocal count
        count += 1

    def product(x):
        flat = jnp.concatenate(x)
        rows = flat + rate * COUPLING @ flat
        return ALSO @ flat, StageUnknowns(rows[:4], rows[4:])

    def precondition(left):
        jax.debug.callback(counted, left.vdot[0])
        return jax.tree.map(jnp.negative, left)

    nothing = jnp.zeros(2), StageUnknowns(jnp.zeros(4), jnp.zeros(2))
    solve = jax.jit(lambda b: improved(product, precondition, StageUnknowns(b[:4], b[4:]), nothing))
    also, x = solve(rhs)
    jax.effects_barrier()
    return np.asarray(also), np.concatenate(x), count


@pytest.mark.parametrize("rate", [0.003, 0.03, 0.4])
def test_both_results_have_the_accuracy_asked_for(rate):
    """x and B x are those of a direct solution, whether the iterations converge fast or slowly. The limit
    is ten times the tolerance of 2e-10, because the iterations measure their error in another norm."""
    also, x, _ = solution(rate, RHS)
    exact = np.linalg.solve(np.eye(6) + rate * COUPLING, RHS)
    assert np.abs(x - exact).max() < 2e-9 * np.abs(exact).max()
    assert np.abs(also - ALSO @ exact).max() < 2e-9 * np.abs(ALSO @ exact).max()


def test_number_of_iterations():
    """A right-hand side of zero, as for steps after the last instant of an objective, takes one iteration.
    One of NaN takes one iteration and gives NaN. Diverging iterations end at the largest number allowed,
    and give NaN, not what they have come to."""
    also, x, count = solution(0.03, 0.0 * RHS)
    assert count == 1 and not also.any() and not x.any()
    also, x, count = solution(0.03, np.nan * RHS)
    assert count == 1 and np.isnan(also).all() and np.isnan(x).all()
    also, x, count = solution(2.0, RHS)
    assert count == MAX_LINEAR_ITERATIONS and np.isnan(also).all() and np.isnan(x).all()
