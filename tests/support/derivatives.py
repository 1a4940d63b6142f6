"""Derivatives in reverse mode of several outputs at several inputs, by one program.

A program with a derivative takes half a minute to compile, whatever its size. A test therefore asks one
program for the outputs, their derivatives and the members of its batch. That forward mode agrees with
reverse mode is tested for every method in `tests/steppers/test_every_stepper.py`.
"""

import jax
import jax.numpy as jnp
import numpy as np

from support.quick import jit


def stacked(members):
    """Arrays of a batch, from the trees of its members."""
    return jax.tree.map(lambda *x: jnp.stack([jnp.asarray(y, float) for y in x]), *members)


def batch_with_slopes(end):
    """Returns a function of batches (x, w): the outputs end(x) of each member, and the derivative of the
    sum of w * end(x) by x. end: a function from a tree to a dictionary of arrays."""

    def member(x, weights):
        value, pull_back = jax.vjp(end, x)
        return value, pull_back(weights)[0]

    return jit(jax.vmap(member))


def weights_of_each(outputs):
    """One tree of weights per output: random numbers for this output, which lie within [0.5, 1] or
    [-1, -0.5], and zeros for the others."""
    numbers = np.random.default_rng(1)
    shapes = {name: np.shape(x) for name, x in outputs.items()}

    def random(shape):
        return numbers.uniform(0.5, 1.0, shape) * numbers.choice([-1.0, 1.0], shape)

    return [
        {name: random(shape) if name == one else np.zeros(shape) for name, shape in shapes.items()}
        for one in shapes
    ]


def error_of_slope(slope, weights, ends, step):
    """The error of a derivative of the sum of weights * outputs, by the difference quotient of fourth
    order, over the largest quotient of a weighted output. ends: outputs by number of steps, for which
    -2, -1, 1 and 2 are needed."""

    def difference(name, steps):
        return np.asarray(ends[steps][name]) - np.asarray(ends[-steps][name])

    quotients = {
        name: (8.0 * difference(name, 1) - difference(name, 2)) / (12.0 * step)
        for name, w in weights.items()
        if np.any(w)
    }
    wanted = sum(np.sum(weights[name] * x) for name, x in quotients.items())
    return float(abs(slope - wanted) / max(np.abs(x).max() for x in quotients.values()))
