"""Size of programs: equations that JAX traces, instructions that XLA compiles."""

import jax
import jax.numpy as jnp

from esail_jax.compilation.kept import program_of
from esail_jax.compilation.size import count_equations, size_of


def test_nested_equations_are_counted():
    """A call is one equation, and its two equations count at both calls: 2 (1 + 2), and the sum of both."""
    inner = jax.jit(lambda x: jnp.sin(x) * x)
    assert count_equations(jax.make_jaxpr(inner)(1.0)) == 1 + 2
    assert count_equations(jax.make_jaxpr(lambda x: inner(x) + inner(2.0))(1.0)) == 2 * (1 + 2) + 1


def test_all_branches_are_counted():
    """Both branches of a condition are traced and compiled: index, condition, and one equation in each."""
    chosen = jax.make_jaxpr(lambda p, x: jax.lax.cond(p, jnp.sin, jnp.cos, x))(True, 1.0)
    assert count_equations(chosen) == 2 + 1 + 1


def test_size_of_a_program():
    """A program with one equation has one; compiled, it has an instruction and a parameter."""
    size = size_of(program_of(jnp.negative, (), (1.0,)).program)
    assert size.equations == 1 and size.instructions >= 2
