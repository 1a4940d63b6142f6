"""The interface of a method of time integration.

A *stepper* turns a state into a later state and the steps between, one *block* of steps at a time. A block
depends on nothing but the state it begins from, so that a run may stop after any block and go on later,
with the same bits. The simulation (`simulation/advance.py`) calls a stepper in this order:

    state, steps = stepper.init(model, start, until)        once, and again after an event
    state, steps = stepper.block(model, state)              until the next saved instant is passed
    point = stepper.evaluate(model, steps, time)            dense output at a saved instant

A saved instant never forces a step. For derivatives the simulation stores `stepper.tape(steps)` of every
block, and `stepper.replay` takes the same steps again as a differentiable function. Step sizes carry no
derivative.

To add a method, write a subclass of `AbstractStepper` and pass an instance to `simulate(scene,
stepper=...)`, or give it a name in `scenes/integration.py` and `scenes/method_choice.py`. CONTRIBUTING.md
has an example."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax

from esail_jax.array_types import Array, Bool, Float, Int, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.numerics.lockstep import any_member, select
from esail_jax.steppers.log import Log, Statistic
from esail_jax.steppers.results import RESULTS
from esail_jax.system import Power


class Point(NamedTuple):
    """An instant of the motion.

    time [s]; q, v: positions and velocities (`coordinates.Coordinates`); work: external work and dissipated
    energy [J] since the start of the run. exact: true at the end of a step, where q and v satisfy the
    constraints. Between steps they are interpolated, and are projected on the constraints before
    observables are evaluated."""

    time: Scalar
    q: Coordinates
    v: Coordinates
    work: Power
    exact: Bool[Array, ""]


class AbstractState(eqx.Module):
    """The state of a stepper between two blocks. It contains everything that the next block depends on, so
    that a run continues from it with the same bits.

    time: the end of the last step [s]; taken, rejected: numbers of steps since `init`; result:
    `RESULTS.successful` while the stepper can go on, otherwise the reason why it cannot. A subclass adds
    the motion and the memory of the method."""

    if TYPE_CHECKING:  # mypy takes an `AbstractVar` for a field, the first one of every subclass

        @property
        def time(self) -> Scalar: ...
        @property
        def taken(self) -> Scalar: ...
        @property
        def rejected(self) -> Scalar: ...
        @property
        def result(self) -> RESULTS: ...
    else:
        time: eqx.AbstractVar[Scalar]
        taken: eqx.AbstractVar[Scalar]
        rejected: eqx.AbstractVar[Scalar]
        result: eqx.AbstractVar[RESULTS]


class AbstractSteps(eqx.Module):
    """The record of the steps of one block, with all data that dense output needs.

    The first axis of every array is `attempt`; records of several blocks are stacked along an axis `block`
    before it. taken: false for rejected steps and unused places; end: time at the end of the step [s]."""

    if TYPE_CHECKING:  # as in `AbstractState`

        @property
        def taken(self) -> Bool[Array, "*block attempt"]: ...
        @property
        def end(self) -> Float[Array, "*block attempt"]: ...
    else:
        taken: eqx.AbstractVar[Bool[Array, "*block attempt"]]
        end: eqx.AbstractVar[Float[Array, "*block attempt"]]

    @property
    @abstractmethod
    def log(self) -> Log:
        """The log of these steps."""

    @abstractmethod
    def pick(self, index: tuple[Int[Array, ""], ...]) -> Any:
        """One step as `AbstractStepper.evaluate` takes it. index: one integer per leading axis."""

    def find(self, time: Scalar) -> tuple[Int[Array, ""], ...]:
        """The index of the first step taken that ends at `time` [s] or later, one integer per
        leading axis. If there is none, the result is the index of the first place."""
        reaches = self.taken & (time <= self.end)
        return jnp.unravel_index(jnp.argmax(reaches), reaches.shape)


class Motion(NamedTuple):
    """A stepper's state, with the record of the block that led to it: saved instants may lie in that block.

    earlier: numbers of steps taken and rejected before the last call of `init`; jump: largest jump of
    what a law commands so far, None if none is looked for (`simulation/law_jumps.py`)."""

    state: AbstractState
    last: AbstractSteps
    earlier: Float[Array, "2"]
    jump: Scalar | None = None

    @property
    def counts(self) -> Float[Array, "2"]:
        """Numbers of steps taken and of steps rejected since the start of the run."""
        return self.earlier + jnp.stack([self.state.taken, self.state.rejected])


class AbstractStepper(eqx.Module):
    """A method of time integration of

        M vdot + Phi_q^T lam = Q(t, q, v),    Phi(t, q) = 0,    dq/dt = v.

    A subclass gives `name`, `order`, `init`, `block`, `evaluate` and `failure`. Its numbers (step size,
    tolerance) are fields with arrays, so that another value needs no compilation. `model` is the `System`
    in nodal coordinates, or the `RodChain` if `relative_coordinates` is true.

        esail.simulate("baseline", stepper=Collocation(None, jnp.asarray(1e-8)))

    No method raises: under a trace it could not. A complete subclass is in CONTRIBUTING.md."""

    name: eqx.AbstractClassVar[str]
    order: eqx.AbstractClassVar[int]

    statistics: ClassVar[Mapping[str, Statistic]] = {}
    """The numbers that the steps report beside their number and length, by name."""

    relative_coordinates: ClassVar[bool] = False
    """Whether the method integrates a rod chain in the rod vectors, not the positions of its joints."""

    energy_guard: ClassVar[bool] = False
    """Whether a run ends if its energy balance has an error above a tenth of the energy. An unstable
    explicit method need not overflow."""

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
        """The state at the start of a run, or after an event, and a record of steps of length zero,
        in which `evaluate` finds the start.

        start: a `Point` on the constraints; at the start of a run a `RodState` for a method in relative
        coordinates. until: time of the next event [s], infinite if there is none. Error control needs it
        for the first step size, which should not pass the event."""

    @abstractmethod
    def block(self, model: Any, state: AbstractState) -> tuple[AbstractState, AbstractSteps]:
        """The state after the next steps, and their record, in which every array has the same shape
        for every block (`steps_per_block` places).

        A step that fails is tried again with a smaller size, in this block or in the next. If that is not
        possible, the method sets `state.result`."""

    @abstractmethod
    def evaluate(self, model: Any, step: Any, time: Scalar) -> Point:
        """The motion at `time` [s] within a step (dense output). step: a step as
        `AbstractSteps.pick` returns it."""

    def tape(self, steps: AbstractSteps) -> Any:
        """The data of a block that `replay` needs to take the same steps again, by default none."""
        return ()

    def replay(
        self, model: Any, motion: Motion, ended: Motion, tapes: Any, blocks: Int[Array, ""], times: Array
    ) -> tuple[Motion, Point]:
        """Takes the blocks of a window again, as a function of `model` and `motion` that JAX can
        differentiate in forward and in reverse mode. Step sizes carry no derivative.

        ended: the motion at the end of the window; tapes: the tapes of all places for blocks (first axis
        `block`); blocks: the number of batches of blocks that were taken; times: the saved instants [s].
        Returns the motion at the end of the window and the points at the instants (first axis `instant`).

        The default calls `block` again. This is right for a method whose blocks contain no `while_loop`,
        take at least one step each, and are not batched (`blocks_per_batch` is 1)."""
        return replay_blocks(
            self, model, motion, lambda state, tape: self.block(model, state), tapes, blocks, times
        )

    @abstractmethod
    def failure(self, model: Any, state: AbstractState, log: Log) -> str:
        """A sentence about a failed run for its user: the time, the step size, and what to try.

        state: the last state; log: the log of the last call, as NumPy arrays."""

    def energy_hint(self) -> str:
        """A sentence for people on what to try where the energy balance is off."""
        fixed = getattr(self, "step_size", None) is not None
        return "Ask for a shorter step." if fixed else "Ask for a smaller tolerance."

    def error_estimates(self, state: AbstractState) -> dict[str, Scalar]:
        """The estimated accumulated errors by name, relative to the range of the signal. The result
        is empty for a method that controls its error."""
        return {}


# ---- replay of blocks, for derivatives --------------------------------------------------------------


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

    The other arguments are those of `AbstractStepper.replay`. Reverse mode stores the state at the start of
    every block and computes the block again. Places after the last block are skipped."""
    again = jax.checkpoint(block)
    count = stepper.blocks_per_window

    def one(motion, row):
        index, tape = row

        def go(motion):
            state, last = again(motion.state, tape)
            new = motion._replace(state=state, last=last)
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
    """Dense output at instants [s] that lie in the block `last` or in the stacked blocks `steps`,
    and NaN for later instants.

    taken: true for the stacked steps that count. All steps are picked by one `vmap`. In a loop over the
    instants, the derivative of every pick would have the size of all steps together."""
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
"""Number of instants that are evaluated together by `vmap` under a trace."""


def nan_like(values: Any) -> Any:
    """NaN for every floating-point number of a tree, and zero for integers and truth values."""
    return jax.tree.map(
        lambda x: jnp.full_like(x, jnp.nan if jnp.issubdtype(x.dtype, jnp.inexact) else 0), values
    )
