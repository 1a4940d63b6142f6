"""The growth of a small perturbation along a run: an estimate of the largest Lyapunov exponent.

Two runs whose starts differ by delta(0) differ by delta(t). As delta(0) goes to zero, delta(t) is the
tangent of the run, which forward-mode differentiation carries along with the motion. It obeys a linear
equation and needs no rescaling. In regular motion |delta| grows like a power of time. In chaotic motion it
grows like exp(lambda t), and two accurate runs part where the errors of their steps, times this growth,
become visible.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float
from esail_jax.compilation.jit import jit
from esail_jax.coordinates import Coordinates
from esail_jax.simulation.rectification import AnyPoint

INSTANTS = 201
"""Number of instants, equally spaced over the run, at which the perturbation is measured."""

LEAST_INSTANTS = 50
"""Least number of instants from which a growth is measured: five in each of the parts below."""

EARLY, MIDDLE, LATE = (0.0, 0.1), (0.45, 0.55), (0.9, 1.0)
"""Parts of the run in which the largest perturbation is taken: a single instant may lie near a zero of an
oscillation."""

WARN_GROWTH = 1e6
"""Growth above which a run is reported. The errors of a step are some 1e-9 of a tether's length, so two
runs differ by a thousandth of the length after this growth. Regular motion, whose perturbations grow like t
or t^2, gains a factor of 10 or 100 from the first tenth of a run to its end."""


class Stability(NamedTuple):
    """How a small perturbation of the start grows.

    growth_rate: finite-time Lyapunov exponent [1/s], the mean logarithmic growth rate of the perturbation
    in the second half of the run; about 1.4 over the duration where the perturbation grows in proportion to
    time; growth: largest perturbation in the last tenth of the run, relative to that in the first tenth;
    parted: the time [s] at which the growth exceeds WARN_GROWTH, infinite if it does not; failed: the time
    [s] of the last instant before the differentiated run failed, which ends what is measured; infinite if
    that run did not fail."""

    growth_rate: float
    growth: float
    parted: float
    failed: float = np.inf

    @property
    def warning(self) -> str:
        """Sentences for a run that two accurate computations would not agree on, and for one whose
        perturbation could not be followed to the end; otherwise empty."""
        sentences = []
        if np.isfinite(self.parted):
            sentences.append(
                f"The motion is unstable or chaotic: a small perturbation grows {self.growth:.1e}-fold, at "
                f"{self.growth_rate:.2e} 1/s in the second half, so that accurate runs part after about "
                f"{self.parted:.0f} s."
            )
        if np.isfinite(self.failed):
            sentences.append(
                "The growth of a small perturbation could not be computed to the end: the run with it "
                f"failed after {self.failed:.0f} s."
            )
        return " ".join(sentences)


def perturbation(point: AnyPoint, seed: int = 0) -> Coordinates:
    """A random direction of velocities [m/s] that keeps all constraints: every node but the roots
    of the tethers gets a velocity, the hub and the slopes of the nodes get none."""
    shape = point.v.tether.shape
    random = np.random.default_rng(seed).normal(size=shape)
    random[1:] = 0.0
    random[..., 0, :] = 0.0
    hub = None if point.v.hub is None else jnp.zeros_like(point.v.hub)
    return Coordinates(jnp.asarray(random), hub)


def stability_of(
    positions: Callable[[AnyPoint], Float[Array, "time *point 3"]],
    start: AnyPoint,
    times: Float[np.ndarray, " time"],
) -> Stability:
    """The stability of a run.

    positions: a function that JAX can differentiate, of the start of the run, with the positions [m] of
    tips or joints at `times`; start: the start of the run; times: instants [s], the first one is that of
    the start. If the differentiated run fails, the instants before its failure count; all numbers are NaN
    if they are fewer than LEAST_INSTANTS. A run in chaotic motion may fail where another one, with rounding
    errors of its own, goes on."""

    def tangent(point, direction):
        return jax.jvp(lambda v: positions(point._replace(v=v)), (point.v,), (direction,))

    values, change = (np.asarray(x) for x in jit(tangent)(start, perturbation(start)))
    size = np.sqrt(np.square(change).reshape(len(times), -1).sum(1))
    good = np.isfinite(values).reshape(len(times), -1).all(1) & np.isfinite(size)
    return measured(size, times) if good.all() else cut_short(size, times, int(np.argmin(good)))


def cut_short(size: Float[np.ndarray, " time"], times: Float[np.ndarray, " time"], count: int) -> Stability:
    """The stability from the first `count` sizes of a perturbation, after which its run failed."""
    failed = float(times[max(count - 1, 0)])
    if count < LEAST_INSTANTS:
        return Stability(np.nan, np.nan, np.nan, failed)
    return measured(size[:count], times[:count])._replace(failed=failed)


def measured(size: Float[np.ndarray, " time"], times: Float[np.ndarray, " time"]) -> Stability:
    """The stability from the sizes of a perturbation at equally spaced times [s]."""
    duration = times[-1] - times[0]
    part = (times - times[0]) / duration

    def largest(interval: tuple[float, float]) -> float:
        return float(size[(part >= interval[0]) & (part <= interval[1])].max())

    early, middle, late = (largest(interval) for interval in (EARLY, MIDDLE, LATE))
    rate = (np.log(late) - np.log(middle)) / (0.5 * (sum(LATE) - sum(MIDDLE)) * duration)
    apart = size > WARN_GROWTH * early
    return Stability(float(rate), late / early, float(times[np.argmax(apart)]) if apart.any() else np.inf)
