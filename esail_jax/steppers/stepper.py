"""The interface of a method of time integration.

A *stepper* turns a state into a later state and the steps between, one *block* of steps at a time. A block
depends on nothing but the state it begins from, so that a run may stop after any block and go on later,
with the same bits. The simulation (`simulation/advance.py`) calls a stepper in this order:

    state, steps = stepper.init(model, start, until)        once, and again after an event
    state, steps = stepper.block(model, state)              until the next saved instant is passed
    point = stepper.evaluate(model, steps, time)            dense output at a saved instant

A saved instant never forces a step. For derivatives the simulation keeps `stepper.tape(steps)` of every
block, and `stepper.replay` takes the same steps again as a differentiable function. Step sizes carry no
derivative.

To add a method, write a subclass of `AbstractStepper` and hand it to `simulate(scene, stepper=...)`, or
give it a name in `scenes/method_choice.py`."""

from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar, Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Bool, Float, Int, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.numerics.lockstep import any_member, select
from esail_jax.steppers.results import RESULTS
from esail_jax.system import Power


class Point(NamedTuple):
    """An instant of the motion: time [s], positions, velocities, and the external work and the dissipated
    energy [J] since the start of the run.

    exact: true at the end of a step, where q and v are taken as they are. Between steps they come from an
    interpolation and are projected on the constraints before anything is observed."""

    time: Scalar
    q: Coordinates
    v: Coordinates
    work: Power
    exact: Bool[Array, ""]


class AbstractState(eqx.Module):
    """Everything that a stepper needs to go on, bit for bit: a checkpoint.

    time: the end of the last step [s]; taken, rejected: numbers of steps since `init`; result: why the
    stepper cannot go on, `RESULTS.successful` while it can."""

    time: eqx.AbstractVar[Scalar]
    taken: eqx.AbstractVar[Scalar]
    rejected: eqx.AbstractVar[Scalar]
    result: eqx.AbstractVar[RESULTS]


class Log(NamedTuple):
    """A short account of the attempted steps of a block, in order, first axis `attempt`.

    tried: false where the block had ended before; taken: false where the step was rejected; end, size:
    time at the end of the step and its length [s]; statistics: more numbers by name."""

    tried: Bool[Array, "*attempt"]
    taken: Bool[Array, "*attempt"]
    end: Float[Array, "*attempt"]
    size: Float[Array, "*attempt"]
    statistics: dict[str, Float[Array, "*attempt"]]

    def table(self) -> Float[Array, "*attempt column"]:
        """The account as one array, which a loop writes faster than its parts. The size has a minus sign
        where the step was rejected, and is 0 where none was tried."""
        size = jnp.where(self.taken, self.size, jnp.where(self.tried, -self.size, 0.0))
        columns = [self.end, size, *(self.statistics[name] for name in sorted(self.statistics))]
        return jnp.stack(columns, axis=-1)

    @classmethod
    def from_table(cls, table: Float[np.ndarray, "*attempt column"], names: Iterable[str]) -> "Log":
        """The account from its table, on the host. names: those of the statistics."""
        end, size, *others = np.moveaxis(table, -1, 0)
        statistics = dict(zip(sorted(names), others, strict=True))
        return cls(size != 0.0, size > 0.0, end, np.abs(size), statistics)


class AbstractSteps(eqx.Module):
    """The steps of one block, with what dense output needs of each: first axis `attempt`, or `block,
    attempt` where several blocks are stacked."""

    taken: eqx.AbstractVar[Bool[Array, "*block attempt"]]
    end: eqx.AbstractVar[Float[Array, "*block attempt"]]

    @property
    @abstractmethod
    def log(self) -> Log:
        """The account of these steps."""

    @abstractmethod
    def pick(self, index: tuple[Int[Array, ""], ...]) -> Any:
        """One step, from its index along the leading axes."""

    def find(self, time: Scalar) -> tuple[Int[Array, ""], ...]:
        """Index of the first step that ends at a time [s] or later."""
        reaches = self.taken & (time <= self.end)
        return jnp.unravel_index(jnp.argmax(reaches), reaches.shape)


class Statistic(NamedTuple):
    """A number that is kept for every saved instant: its unit, and how the values of the steps since the
    instant before are put together."""

    unit: str
    over: Literal["mean", "largest", "last"]


class Motion(NamedTuple):
    """A stepper's state with the block of steps that led to it: the next saved instants may lie in that
    block.

    earlier: numbers of steps taken and rejected before the stepper last began afresh."""

    state: AbstractState
    last: AbstractSteps
    earlier: Float[Array, "2"]

    @property
    def counts(self) -> Float[Array, "2"]:
        """Numbers of steps taken and rejected since the start of the run."""
        return self.earlier + jnp.stack([self.state.taken, self.state.rejected])


class AbstractStepper(eqx.Module):
    """A method of time integration. Its numbers (step size, tolerance) are leaves, so that other values do
    not compile again.

    model: what is integrated, a `System` in nodal coordinates, or a `RodChain` where
    `relative_coordinates` is true."""

    name: eqx.AbstractClassVar[str]
    order: eqx.AbstractClassVar[int]

    statistics: ClassVar[Mapping[str, Statistic]] = {}
    """What the steps report beside their number and length."""

    relative_coordinates: ClassVar[bool] = False
    """Whether the method integrates a rod chain in the rod vectors, not the positions of its joints."""

    energy_guard: ClassVar[bool] = False
    """Whether a run is given up where its energy balance is off by a tenth. An explicit method that is
    unstable need not overflow."""

    steps_per_block: ClassVar[int] = 16
    """Largest number of attempted steps in a block."""

    blocks_per_batch: ClassVar[int] = 1
    """Number of blocks whose logs and tapes are gathered before they are stored. A loop over small arrays
    alone runs several times as fast as one with a large buffer, which matters for blocks of a few
    microseconds."""

    blocks_per_window: ClassVar[int] = 16
    """Largest number of batches of blocks between two checkpoints of a derivative."""

    instants_per_window: ClassVar[int] = 64
    """Largest number of saved instants between two checkpoints of a derivative."""

    @abstractmethod
    def init(self, model: Any, start: Any, until: Scalar) -> tuple[AbstractState, AbstractSteps]:
        """The state in which a run begins, or goes on after an event, and steps of no length in which
        `evaluate` finds the start.

        start: a `Point` on the constraints, or a `RodState` for a method in relative coordinates; until
        [s]: the next event, which a first step does not pass."""

    @abstractmethod
    def block(self, model: Any, state: AbstractState) -> tuple[AbstractState, AbstractSteps]:
        """The state after some steps, and these steps. A step that fails is tried again with a shorter
        length, in this block or the next; when nothing helps, `state.result` says why."""

    @abstractmethod
    def evaluate(self, model: Any, step: Any, time: Scalar) -> Point:
        """Dense output at a time [s] within one step, as `AbstractSteps.pick` returns it."""

    def tape(self, steps: AbstractSteps) -> Any:
        """The part of a block's steps that `replay` needs to take them again; by default nothing."""
        return ()

    def replay(
        self, model: Any, motion: Motion, ended: Motion, tapes: Any, blocks: Int[Array, ""], times: Array
    ) -> tuple[Motion, Point]:
        """The blocks of a window again, as a differentiable function of `model` and `motion`.

        ended: the motion at the end of the window; tapes: those of its blocks, first axis `block`, of
        which `blocks` were taken; times: the saved instants (instant). Returns the motion at the end, and
        the points at the instants (first axis `instant`). By default `block` is called again, which serves
        a method whose blocks JAX can differentiate in both modes (no `while_loop`) and always takes at
        least one step."""
        return replay_blocks(
            self, model, motion, lambda state, tape: self.block(model, state), tapes, blocks, times
        )

    @abstractmethod
    def failure(self, model: Any, state: AbstractState, log: Log) -> str:
        """A sentence about a failed run, for people: the time, the step, what to try. log: of the last
        call."""

    def energy_hint(self) -> str:
        """A sentence for people on what to try where the energy balance is off."""
        fixed = getattr(self, "step_size", None) is not None
        return "Ask for a shorter step." if fixed else "Ask for a smaller tolerance."

    def error_estimates(self, state: AbstractState) -> dict[str, Scalar]:
        """Estimated errors so far by name, in parts of a signal's range; empty where the method controls
        its error."""
        return {}


# ---- blocks again, for derivatives --------------------------------------------------------------


def replay_blocks(
    stepper: AbstractStepper,
    model: Any,
    motion: Motion,
    block: Callable[[Any, Any], tuple[Any, AbstractSteps]],
    tapes: Any,
    blocks: Int[Array, ""],
    times: Float[Array, " instant"],
) -> tuple[Motion, Point]:
    """The motion after `blocks` calls of `state, steps = block(state, tape)`, and the points at the
    instants.

    The arguments are those of `AbstractStepper.replay`. Reverse mode keeps the state at the start of every
    block and computes the block again; blocks beyond the last are skipped."""
    again = jax.checkpoint(block)
    count = stepper.blocks_per_window

    def one(motion, row):
        index, tape = row

        def go(motion):
            new = Motion(*again(motion.state, tape), motion.earlier)
            return select(index < blocks, new, motion)

        motion = lax.cond(any_member(index < blocks), go, lambda motion: motion, motion)
        taken = motion.last.taken & (index < blocks)
        return motion, (motion.last, taken)

    end, (steps, taken) = lax.scan(one, motion, (jnp.arange(count), tapes))
    return end, points_within(stepper, model, motion.last, steps, taken, times)


def points_within(
    stepper: AbstractStepper,
    model: Any,
    last: AbstractSteps,
    steps: AbstractSteps,
    taken: Bool[Array, "block attempt"],
    times: Float[Array, " instant"],
) -> Point:
    """Dense output at instants that lie in the block `last` or in the stacked blocks `steps`, NaN beyond
    them.

    taken: which of the stacked steps count. All steps are picked at once: one after the other, the
    derivative of each instant would be as large as all steps together."""
    reached = jnp.where(taken, steps.end, -jnp.inf).max(initial=-jnp.inf)
    before = jnp.where(last.taken, last.end, -jnp.inf).max(initial=-jnp.inf)

    def pick(time):
        ends = taken & (time <= steps.end)
        index = jnp.unravel_index(jnp.argmax(ends), ends.shape)
        return select(time <= before, last.pick(last.find(time)), steps.pick(index))

    picked = jax.vmap(pick)(times)
    points = lax.map(
        lambda row: stepper.evaluate(model, *row), (picked, times), batch_size=INSTANTS_TOGETHER
    )
    known = times <= jnp.maximum(reached, before)
    return jax.vmap(lambda good, point: select(good, point, nan_like(point)))(known, points)


INSTANTS_TOGETHER = 32
"""Number of instants that are computed side by side under a trace."""


def nan_like(values: Any) -> Any:
    """NaN for every number, zero for integers and truth values."""
    return jax.tree.map(
        lambda x: jnp.full_like(x, jnp.nan if jnp.issubdtype(x.dtype, jnp.inexact) else 0), values
    )
