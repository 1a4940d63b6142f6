"""Selection of the vibrations among the eigenvalues of a sail.

Of each conjugate pair one eigenvalue is kept. The spin angle (s = 0, twice) is left out. An overdamped
vibration has two real eigenvalues -a and -b, a vibration of natural frequency sqrt(a b) with the damping
ratio (a + b) / (2 sqrt(a b)) > 1: they are brought together by their shapes.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from esail_jax.array_types import Complex, Inexact

Host = np.ndarray

AT_REST = 1e-4
"""Eigenvalues of a neutral motion, the spin angle, are zero but for rounding, which splits the double zero
by the square root: up to this fraction of the spin rate. How many there are is known beforehand."""

REAL = 1e-3
"""Largest |Im s| / |s| of an overdamped motion among waves of both directions: their coupling by the hub
gives real eigenvalues a small imaginary part."""

ALIKE = 0.5
"""Least likeness of the shapes of the two motions of an overdamped vibration."""


class Vibration(NamedTuple):
    """A vibration. eigenvalue: s [1/s] with Im s > 0, of an overdamped one the slower; natural_frequency:
    [rad/s]; damping_ratio; motion: column of the spectrum; wave: 1 or -1, the sign of Im s of that column,
    0 for one that is standing."""

    eigenvalue: complex
    natural_frequency: float
    damping_ratio: float
    motion: int
    wave: int


def vibrations(
    values: Complex[Host, " mode"],
    motions: Inexact[Host, "n mode"],
    mass: Host,
    spin: float,
    waves: bool,
    neutral: int,
) -> tuple[list[Vibration], int]:
    """The vibrations, and the number of eigenvalues left out because they are zero.

    waves: the motions are waves of one number, whose conjugates are those of the opposite number: every
    eigenvalue is a vibration of its own, and an overdamped one stands for both numbers. neutral: number of
    eigenvalues that are zero, two for each neutral motion."""
    at_rest = np.zeros(len(values), bool)
    at_rest[np.argsort(np.abs(values))[:neutral]] = True
    at_rest &= np.abs(values) < AT_REST * abs(spin)
    real = ~at_rest & (np.abs(values.imag) <= (REAL if waves else 0.0) * np.abs(values))
    kept = []
    for k in np.flatnonzero(~at_rest & ~real & ((values.imag > 0.0) | waves)):
        s = complex(values[k])
        shown = complex(s.real, abs(s.imag))
        wave = int(np.sign(s.imag)) if waves else 0
        kept.append(Vibration(shown, abs(s), -s.real / abs(s), int(k), wave))
    copies = 2 if waves else 1
    for slow, fast in overdamped(values, motions, mass, np.flatnonzero(real)):
        a = complex(values[slow].real)
        if fast is None:
            alone = Vibration(a, abs(a), -float(np.sign(a.real)), int(slow), 0)
        else:
            b = values[fast].real
            natural = float(np.sqrt(a.real * b))
            alone = Vibration(a, natural, float(-(a.real + b) / (2.0 * natural)), int(slow), 0)
        kept += [alone] * copies
    return kept, int(at_rest.sum())


def overdamped(
    values: Complex[Host, " mode"], motions: Inexact[Host, "n mode"], mass: Host, real: Host
) -> list[tuple[int, int | None]]:
    """Pairs of real eigenvalues that belong to one vibration; None beside one that is alone."""
    order = real[np.argsort(np.abs(values[real]))]
    decaying = order[values[order].real < 0.0]
    alone = [int(k) for k in order if values[k].real >= 0.0]
    half = (len(decaying) + 1) // 2
    slow, fast = decaying[:half], decaying[half:]
    x, y = motions[:, slow], motions[:, fast]
    norms = [np.sqrt(np.abs((z.conj() * (mass @ z)).sum(0))) for z in (x, y)]
    alike = np.abs(x.conj().T @ (mass @ y)) / (norms[0][:, None] * norms[1])
    pairs: list[tuple[int, int | None]] = []
    chosen = zip(*linear_sum_assignment(-alike), strict=True)
    matched = [(i, j) for i, j in chosen if alike[i, j] >= ALIKE]
    pairs += [(int(slow[i]), int(fast[j])) for i, j in matched]
    alone += [int(k) for i, k in enumerate(slow) if i not in {i for i, _ in matched}]
    alone += [int(k) for j, k in enumerate(fast) if j not in {j for _, j in matched}]
    return pairs + [(k, None) for k in alone]
