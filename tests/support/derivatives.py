"""A check of derivatives in both modes against difference quotients."""

import jax
import jax.numpy as jnp
import numpy as np

from support.quick import jit

MOVES = (0.0, -2.0, -1.0, 1.0, 2.0)
"""The number itself and those of the difference quotient, in units of its change."""

SMALLEST = 1e-6
"""A derivative whose part of a signal, for the change of its number, is smaller than this is compared
relative to this part: the rounding of the quotient is up to 1e-13 of the signal."""


def pattern(shape):
    """Numbers of a shape that are all different, so that components of a symmetric sail do not cancel."""
    return np.sin(1.0 + 7.0 * np.arange(np.prod(shape, dtype=int))).reshape(shape)


def check_both_modes(signals, numbers):
    """Checks that reverse mode agrees with forward mode to 1e-10 of the parts of a sum, and that every
    number matters for some signal. Returns, by key and signal, the difference of forward mode from the
    quotient of fourth order, relative to the largest derivative of the signal by this key (or to SMALLEST).

    signals: maps a dictionary of numbers to a dictionary of arrays; numbers: values and their changes in a
    difference quotient, by key. Two programs are compiled, one of each mode."""
    at = {key: jnp.asarray(value, float) for key, (value, _) in numbers.items()}

    def moved(key, change):
        return at | {key: at[key] + change * np.asarray(numbers[key][1])}

    def along(key):
        return {
            k: jnp.asarray((k == key) * np.asarray(change), float) for k, (_, change) in numbers.items()
        }

    members = [(moved(key, c), along(key)) for key in numbers for c in MOVES]
    given = jax.tree.map(lambda *rows: jnp.stack(rows), *members)
    values, slopes = jit(jax.vmap(lambda x, dx: jax.jvp(signals, (x,), (dx,))))(*given)
    count = len(MOVES)
    tangents = {name: np.asarray(x)[::count] for name, x in slopes.items()}
    smallest = {name: SMALLEST * np.abs(x).max() + 1e-300 for name, x in values.items()}
    weights = {
        name: pattern(x.shape[1:]) / max(np.abs(x).max(), smallest[name]) for name, x in tangents.items()
    }
    back = jit(lambda x, w: jax.vjp(signals, x)[1](w)[0])(at, weights)
    errors = {}
    for i, key in enumerate(numbers):
        parts = np.concatenate([np.ravel(weights[name] * x[i]) for name, x in tangents.items()])
        found = (back[key] * np.asarray(numbers[key][1])).sum()
        assert abs(found - parts.sum()) < 1e-10 * np.abs(parts).sum(), key
        matters = False
        for name, tangent in tangents.items():
            _, *x = np.asarray(values[name])[count * i : count * (i + 1)]
            quotient = (8.0 * (x[2] - x[1]) - (x[3] - x[0])) / 12.0
            part = np.abs(quotient).max()
            matters |= part > smallest[name]
            errors[key, name] = np.abs(tangent[i] - quotient).max() / max(part, smallest[name])
        assert matters, key
    return errors
