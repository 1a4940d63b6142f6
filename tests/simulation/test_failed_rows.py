"""Rows of a traced run after a failure are NaN, and so are their derivatives in both modes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax.simulation.traced import nan_unless, zero_of


def row(numbers, good):
    """A row of a run, which depends on the first of its numbers."""
    values = jnp.stack([3.0 * numbers["spin"], numbers["spin"] ** 2])
    return nan_unless(good, values, zero_of(numbers))


@pytest.mark.parametrize("derivative", [jax.jacfwd, jax.jacrev])
def test_a_failed_row_has_no_derivative(derivative):
    """A selection alone would give zero, or the derivative of the rows before: wrong without a word."""
    numbers = {"spin": jnp.asarray(2.0), "infinite": jnp.asarray(jnp.inf), "count": jnp.asarray(3)}

    def of_spin(spin, good):
        return row(numbers | {"spin": spin}, jnp.asarray(good))

    np.testing.assert_array_equal(of_spin(numbers["spin"], True), [6.0, 4.0])
    np.testing.assert_array_equal(derivative(of_spin)(numbers["spin"], True), [3.0, 4.0])
    assert np.isnan(of_spin(numbers["spin"], False)).all()
    assert np.isnan(derivative(of_spin)(numbers["spin"], False)).all()


def test_rows_of_whole_numbers_stay():
    """They have neither NaN nor a derivative."""
    assert int(nan_unless(jnp.asarray(False), jnp.asarray(7), jnp.asarray(0.0))) == 7
