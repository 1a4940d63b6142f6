"""Explicit Runge-Kutta methods on equations with known solutions: single steps, and derivatives of runs."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax.steppers.runge_kutta import METHODS, RungeKutta, advance
from support.quick import jit


class Decay(eqx.Module):
    """The right-hand side of y' = cos t - k y."""

    k: jax.Array

    def __call__(self, time, y):
        return jnp.cos(time) - self.k * y


def method_of(name, step=None):
    if step is not None:
        return RungeKutta(jnp.asarray(step), None, None, name)
    return RungeKutta(None, jnp.asarray(1e-10), jnp.ones(()), name)


@pytest.mark.parametrize("name", METHODS)
def test_a_step_is_the_librarys(name):
    """New value, error estimate and first slope of the next step agree with those of diffrax, to
    rounding."""
    f, method, h = Decay(jnp.asarray(0.7)), method_of(name, 0.3), jnp.asarray(0.3)
    start = method.point(f, jnp.asarray(0.2), jnp.asarray(1.5))
    new, error = method.step(f, start, h)
    solver, terms = METHODS[name], diffrax.ODETerm(lambda t, y, _: f(t, y))
    state = solver.init(terms, 0.2, 0.5, jnp.asarray(1.5), None)
    exact, estimate, *_ = solver.step(terms, 0.2, 0.5, jnp.asarray(1.5), None, state, False)
    np.testing.assert_allclose(new.y, exact, rtol=1e-14)
    np.testing.assert_allclose(error, estimate, rtol=0, atol=1e-15)
    np.testing.assert_allclose(new.slope, f(0.5, exact), rtol=1e-13)
    np.testing.assert_allclose(new.time, 0.5, rtol=1e-15)


@pytest.mark.parametrize("step", [None, 0.05], ids=["controlled", "fixed"])
def test_derivative_of_a_run(step):
    """dy/dk and dy/dy_0 of y' = cos t - k y agree with the closed form in forward and reverse mode.

    The instants lie within steps.
    """
    times = (0.31, 0.93, 2.0)

    def run(k, y0):
        f, method = Decay(k), method_of("tsit5", step)
        progress, found = method.start(f, jnp.zeros(()), y0), []
        for time in times:
            progress, y = advance(method, f, progress, jnp.asarray(time))
            found.append(y)
        return jnp.stack(found)

    def exact(k, y0):
        t = jnp.asarray(times)
        forced = (k * jnp.cos(t) + jnp.sin(t)) / (1 + k**2)
        return forced + (y0 - k / (1 + k**2)) * jnp.exp(-k * t)

    at = (jnp.asarray(0.7), jnp.asarray(1.5))
    np.testing.assert_allclose(jit(run)(*at), exact(*at), rtol=1e-7)
    forward, reverse = (jit(mode(run, (0, 1)))(*at) for mode in (jax.jacfwd, jax.jacrev))
    for one, other, known in zip(forward, reverse, jax.jacfwd(exact, (0, 1))(*at), strict=True):
        np.testing.assert_allclose(one, known, rtol=1e-7)
        np.testing.assert_allclose(one, other, rtol=1e-12)
