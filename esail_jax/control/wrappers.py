"""Wrappers around a sampled voltage law: what disturbs the way from the sail to the law and back."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from esail_jax.array_types import Array, Int, PerTether, Rotation, Scalar
from esail_jax.control.calls_of_law import first_memory, updated
from esail_jax.measurements import Measurements
from esail_jax.numerics.small_matrices import matmul

DIRECTIONS = ("chords", "wind", "momentum_axis")
"""Measurements that are unit vectors. Noise turns them, with a standard deviation in rad."""

AMOUNTS = ("angular_velocity", "tip_position", "tip_velocity", "root_tension")
"""Measurements to which noise is added, with a standard deviation in their own unit."""


class Wrapper(eqx.Module):
    """A law around another one. A subclass gives `init` and `update`. period: that of the wrapped law."""

    law: eqx.AbstractVar[Any]

    @property
    def period(self) -> float:
        """Control period [s]."""
        return self.law.period

    @abstractmethod
    def init(self, measurements: Measurements) -> Any:
        """The memory at the start."""

    @abstractmethod
    def update(self, measurements: Measurements, memory: Any) -> tuple[PerTether | Scalar, Any]:
        """The voltages [V] and the next memory."""

    def first(self, measurements: Measurements) -> Any:
        """The memory of the wrapped law at the start; None if it has none."""
        return first_memory(self.law, measurements)

    def next(self, measurements: Measurements, memory: Any) -> tuple[PerTether | Scalar, Any]:
        """The voltages [V] of the wrapped law, and its next memory."""
        return updated(self.law, measurements, memory)


class Noisy(Wrapper):
    """A law whose sensors have white noise: every sample draws independent normal numbers.

    spread: standard deviations by measurement. "rotation" [rad] turns attitude, spin axis and roots
    together, as the error of a star tracker does; those of `DIRECTIONS` [rad] and of `AMOUNTS` are
    disturbed one by one. seed: an integer; two laws with the same seed see the same noise. Raises
    ValueError for other names.
    """

    law: Any
    spread: dict[str, Scalar | float]
    seed: Int[Array, ""]

    def __init__(self, law: Any, spread: dict[str, Scalar | float], seed: int | Int[Array, ""]):
        known = ("rotation", *DIRECTIONS, *AMOUNTS)
        for name in spread:
            if name not in known:
                raise ValueError(f"`spread` must have names among {', '.join(known)}, but has {name!r}")
        self.law, self.spread, self.seed = law, dict(spread), jnp.asarray(seed)

    def init(self, measurements: Measurements) -> Any:
        return jnp.zeros((), int), self.first(measurements)

    def update(self, measurements: Measurements, memory: Any) -> tuple[PerTether | Scalar, Any]:
        count, inner = memory
        key = jax.random.fold_in(jax.random.key(self.seed), count)
        volts, inner = self.next(self.disturbed(measurements, key), inner)
        return volts, (count + 1, inner)

    def disturbed(self, measurements: Measurements, key: Array) -> Measurements:
        """The measurements with the noise of one sample."""
        for name, one in zip(self.spread, jax.random.split(key, len(self.spread)), strict=True):
            value = getattr(measurements, name)
            noise = self.spread[name] * jax.random.normal(one, (3,) if name == "rotation" else value.shape)
            if name == "rotation":
                measurements = turned(measurements, noise)
                continue
            value = value + noise
            if name in DIRECTIONS:
                value = value / jnp.linalg.norm(value, axis=0)
            measurements = measurements._replace(**{name: value})
        return measurements


def turned(measurements: Measurements, angles: Array) -> Measurements:
    """The measurements whose attitude is turned by small angles about the axes of B [rad]."""
    before = measurements.rotation
    after = matmul(before, small_rotation(angles))
    outward = matmul(after, matmul(before.T, measurements.radial_directions))
    return measurements._replace(rotation=after, spin_axis=after[:, 0], radial_directions=outward)


def small_rotation(angles: Array) -> Rotation:
    """The rotation about a vector by its length (Rodrigues), also for a vector of length zero."""
    x, y, z = angles
    zero = jnp.zeros_like(x)
    skew = jnp.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]])
    size = jnp.sqrt(angles @ angles + 1e-30)
    return jnp.eye(3) + jnp.sinc(size / jnp.pi) * skew + (1.0 - jnp.cos(size)) / size**2 * skew @ skew


class Delayed(Wrapper):
    """A law that sees the sail as it was some samples ago; before the first sample, as at the start.

    samples: the delay, in control periods.
    """

    law: Any
    samples: int = eqx.field(static=True)

    def __init__(self, law: Any, samples: int):
        if not isinstance(samples, int) or samples < 1:
            raise ValueError(f"`samples` must be a positive whole number, but is {samples!r}")
        self.law, self.samples = law, samples

    def init(self, measurements: Measurements) -> Any:
        line = jax.tree.map(lambda x: jnp.broadcast_to(x, (self.samples, *jnp.shape(x))), measurements)
        return line, self.first(measurements)

    def update(self, measurements: Measurements, memory: Any) -> tuple[PerTether | Scalar, Any]:
        line, inner = memory
        volts, inner = self.next(jax.tree.map(lambda x: x[0], line), inner)
        line = jax.tree.map(lambda xs, x: jnp.concatenate([xs[1:], x[None]]), line, measurements)
        return volts, (line, inner)


class Without(Wrapper):
    """A law without some of the sensors: their measurements are None. names: those of `Measurements`."""

    law: Any
    names: tuple[str, ...] = eqx.field(static=True)

    def __init__(self, law: Any, names: Sequence[str]):
        for name in names:
            if name not in Measurements._fields:
                raise ValueError(
                    f"`names` must be among {', '.join(Measurements._fields)}, but has {name!r}"
                )
        self.law, self.names = law, tuple(names)

    def init(self, measurements: Measurements) -> Any:
        return self.first(self.left_of(measurements))

    def update(self, measurements: Measurements, memory: Any) -> tuple[PerTether | Scalar, Any]:
        return self.next(self.left_of(measurements), memory)

    def left_of(self, measurements: Measurements) -> Measurements:
        """The measurements without those of the sensors that are missing."""
        missing: dict[str, Any] = dict.fromkeys(self.names)
        return measurements._replace(**missing)


class FailedSource(Wrapper):
    """A law whose voltage source of one tether fails: its voltage is zero from an instant on.

    tether: number of the tether, from 1; time: the instant [s]. A slew rate of the scene limits this fall
    as any other change.
    """

    law: Any
    tether: int = eqx.field(static=True)
    time: Scalar | float

    def init(self, measurements: Measurements) -> Any:
        return self.first(measurements)

    def update(self, measurements: Measurements, memory: Any) -> tuple[PerTether | Scalar, Any]:
        volts, memory = self.next(measurements, memory)
        count = measurements.chords.shape[1]
        volts = jnp.broadcast_to(jnp.asarray(volts, float), (count,))
        works = measurements.time < self.time
        return volts.at[self.tether - 1].multiply(jnp.where(works, 1.0, 0.0)), memory
