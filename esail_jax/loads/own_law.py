"""Voltage laws that users write: the wrappers that put such a law in the place of one of the package.

A law is an `equinox.Module` with a method `commanded(measurements)`, which returns the voltages [V]. It is
evaluated at every state, as the laws of the package are. With an attribute `period` [s] it is a sampled
law: it is evaluated once in every period, and its voltages are held in between. A sampled law may have a
memory: then it has `init(measurements)`, which returns the memory at the start, and
`update(measurements, memory)`, which returns the voltages and the next memory, in place of `commanded`.
"""

import dataclasses
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, PerTether, Scalar
from esail_jax.control import calls_of_law
from esail_jax.errors import SceneError
from esail_jax.loads.electron_current import PowerLimited
from esail_jax.loads.law_structure import LawStructure
from esail_jax.loads.voltage import VoltageLaw
from esail_jax.loads.voltage_limits import Limits
from esail_jax.measurements import Measurements


def per_tether(volts: Any, count: int) -> PerTether:
    """The voltages that a law returned, one for every tether. Raises SceneError for another shape, and for
    what is no number."""
    try:
        numbers = None if volts is None else jnp.asarray(volts, float)
    except (TypeError, ValueError):
        numbers = None
    if numbers is None:
        raise SceneError("voltage_law", "return voltages [V]", f"returned a {type(volts).__name__}")
    if numbers.shape not in ((), (count,)):
        must = f"return one voltage, or one for each of {count} tethers"
        raise SceneError("voltage_law", must, f"returned an array of shape {numbers.shape}")
    return jnp.broadcast_to(numbers, (count,))


def arrays(memory: Any, subject: str = "voltage_law") -> Any:
    """A memory whose numbers are arrays of a definite type. subject: what its law is called. Raises
    SceneError for anything else, such as keys of `jax.random`, which no file can hold."""

    def array(x: Any) -> Array:
        if not isinstance(x, jax.Array | np.ndarray | np.generic | bool | int | float | complex) or (
            jnp.issubdtype(jnp.result_type(x), jax.dtypes.extended)
        ):
            raise SceneError(subject, "have a memory of numbers", f"it holds {x!r:.60}")
        return jnp.asarray(x, jnp.result_type(x))

    return jax.tree.map(array, memory)


def check_same(before: Any, after: Any, subject: str = "voltage_law") -> None:
    """Raises SceneError unless the memory after a sample has the structure, shapes and types of the memory
    before it. subject: what its law is called."""
    kinds = [
        (jax.tree.structure(x), [(y.shape, y.dtype) for y in jax.tree.leaves(x)]) for x in (before, after)
    ]
    if kinds[0] != kinds[1]:
        words = [jax.tree.map(lambda y: f"{y.dtype}{list(y.shape)}", x) for x in (before, after)]
        must = f"return a memory like the one before, {words[0]}"
        raise SceneError(f"{subject}.update", must, f"returned {words[1]}")


class UsersLaw(VoltageLaw):
    """A law that a user wrote: its structure and its numbers."""

    structure: eqx.AbstractVar[LawStructure]
    numbers: eqx.AbstractVar[tuple[Array, ...]]

    @property
    def law(self) -> Any:
        """The law as the user wrote it."""
        return self.structure.law(self.numbers)


class ContinuousLaw(UsersLaw):
    """A user's law that is evaluated at every state. It has `commanded(measurements)`."""

    structure: LawStructure = eqx.field(static=True)
    numbers: tuple[Array, ...]
    limits: Limits

    name: ClassVar[str] = "voltage law in Python"

    @property
    def measures_motion(self) -> bool:
        return True

    def commanded(self, measurements: Measurements) -> PerTether:
        return per_tether(calls_of_law.commanded(self.law, measurements), measurements.chords.shape[1])


class SampledLaw(UsersLaw):
    """A user's law with a control period, by sample and hold. Between two samples it is a constant voltage.

    The law has `commanded(measurements)`, or `init(measurements)` and `update(measurements, memory)`. held:
    the voltages of the last sample [V]. change: the largest change of a voltage from one sample to the next
    [V], the slew rate times the period; None for no limit.
    """

    structure: LawStructure = eqx.field(static=True)
    numbers: tuple[Array, ...]
    limits: Limits
    change: Scalar | None
    held: PerTether

    name: ClassVar[str] = "sampled voltage law in Python"

    @property
    def constant(self) -> bool:
        return True

    @property
    def value(self) -> PerTether:
        """The constant voltage [V]."""
        return self.held

    def commanded(self, measurements: Measurements) -> PerTether:
        return self.held

    def voltage(self, measurements: Measurements) -> PerTether:
        return self.held

    def holding(self, volts: PerTether) -> "SampledLaw":
        """The law that holds other voltages [V]."""
        return dataclasses.replace(self, held=volts)

    def first_memory(self, measurements: Measurements) -> Any:
        """The memory before the first sample; None for a law without a memory."""
        return arrays(calls_of_law.first_memory(self.law, measurements))

    def sample(self, measurements: Measurements, memory: Any, is_first: bool) -> tuple[PerTether, Any]:
        """The voltages [V] within their limits, and the next memory. The first sample has no voltages
        before it from which its change could be limited."""
        volts, after = calls_of_law.updated(self.law, measurements, memory)
        after = arrays(after)
        check_same(memory, after)
        volts = self.limits(per_tether(volts, len(self.held)))
        if self.change is not None and not is_first:
            volts = self.held + jnp.clip(volts - self.held, -self.change, self.change)
        return volts, after


def sampled_law(law: VoltageLaw) -> SampledLaw | None:
    """The sampled law in a law, which may have a power limit around it; None if there is none."""
    inner = law.law if isinstance(law, PowerLimited) else law
    return inner if isinstance(inner, SampledLaw) else None
