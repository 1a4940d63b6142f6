"""Jumps of the voltage of a law that a user wrote: found while the run takes its steps, and said.

A law may compare what it measures, as in `jnp.where(phase > 0, V, 0)`. Its voltage then jumps at instants
that the steps do not know. Error control makes the steps across them so short that the motion is right to
the tolerance. A derivative is not: it would need the derivative of each such instant, and the steps that
were taken give the derivative at fixed instants. The voltages of such a law are therefore looked at within
every step. A law without comparisons, and every law of the package, costs nothing.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Scalar
from esail_jax.control import calls_of_law
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.loads.electron_current import PowerLimited
from esail_jax.loads.own_law import ContinuousLaw
from esail_jax.measurements import Measurements
from esail_jax.numerics.own_derivative import custom_jvp
from esail_jax.steppers.stepper import AbstractStepper, AbstractSteps
from esail_jax.system import System
from esail_jax.terms import find_term

JUMPING = {
    "lt", "le", "gt", "ge", "eq", "ne", "sign", "floor", "ceil", "round", "rem", "atan2", "argmax",
    "argmin", "sort", "convert_element_type",
}  # fmt: skip
"""Operations of JAX whose results may jump, or decide between numbers."""

PARTS = 8
"""Number of equal parts of a step between whose ends the voltages are compared."""

SUDDEN, SMALL = 0.5, 1e-3
"""A change within one part of a step is a jump if it is more than the first of the whole change within the
step, and more than the second of the largest voltage. A law that the steps resolve changes by some eighths
of its change in one part."""

DISCRETE = "iub"
"""Kinds of the types of integers and truth values."""


def law_of(model: Any) -> tuple[CoulombThrust, ContinuousLaw] | None:
    """Returns the load of a user's law that is evaluated at every state, and the law; None without one."""
    load = find_term(model.loads, CoulombThrust) if isinstance(model, System) else None
    law = None if load is None else load.voltage_law
    law = law.law if isinstance(law, PowerLimited) else law
    return (load, law) if isinstance(law, ContinuousLaw) else None


def is_measured(model: Any, time: Scalar, q: Any, v: Any) -> bool:
    """Tells whether the law of a model may jump: it compares numbers. It is traced for that, at a state
    of these shapes."""
    found = law_of(model)
    if found is None:
        return False
    load, law = found

    def volts_of(measured: Measurements):
        return calls_of_law.commanded(law.law, measured)

    measured = jax.eval_shape(lambda *state: load.with_wind(model.measurements(*state)), time, q, v)
    return any(may_jump(x) for x in operations(jax.make_jaxpr(volts_of)(measured)))


def operations(traced: Any) -> list[Any]:
    """Returns the operations of a traced function that depend on its arguments, with those of the functions
    that they call. Numbers of the law are no arguments: a comparison of these does not jump."""
    function, found = getattr(traced, "jaxpr", traced), []
    depends = {id(x) for x in function.invars}
    for operation in function.eqns:
        if not any(id(x) in depends for x in operation.invars):
            continue
        depends.update(map(id, operation.outvars))
        found.append(operation)
        for inner in jax.tree.leaves(list(operation.params.values()), is_leaf=is_traced_function):
            found += operations(inner) if is_traced_function(inner) else []
    return found


def is_traced_function(x: Any) -> bool:
    """Tells whether a parameter of an operation is a traced function."""
    return hasattr(x, "eqns") or hasattr(getattr(x, "jaxpr", None), "eqns")


def may_jump(operation: Any) -> bool:
    """Tells whether an operation may jump. A conversion does if it makes an integer of a real number."""
    name = operation.primitive.name
    if name == "convert_element_type":
        kinds = [np.dtype(x.aval.dtype).kind for x in (*operation.invars, *operation.outvars)]
        return kinds[0] not in DISCRETE and kinds[1] in DISCRETE
    return name in JUMPING


def largest_jump(stepper: AbstractStepper, model: Any, steps: AbstractSteps) -> Scalar:
    """Returns the largest jump of a voltage within the steps of a block, relative to the largest voltage
    there; zero without any."""
    load, _ = law_of(model)
    log, shape = steps.log, steps.taken.shape

    def within(k):
        step = steps.pick(jnp.unravel_index(k, shape))
        times = log.end[k] - log.size[k] * jnp.linspace(1.0, 0.0, PARTS + 1)

        def volts(time):
            point = stepper.evaluate(model, step, time)
            return load.commanded(model.measurements(time, point.q, point.v))

        return jump_among(lax.map(volts, times, batch_size=PARTS + 1))

    def of_step(k):
        return lax.cond(log.taken[k], within, lambda k: jnp.zeros(()), k)

    return lax.map(of_step, jnp.arange(log.taken.size)).max()


def jump_among(volts: Array) -> Scalar:
    """Returns the largest jump among voltages at the ends of equal parts of a step, (end, tether), relative
    to the largest of them; zero without any."""
    most, largest = jnp.abs(jnp.diff(volts, axis=0)).max(0), jnp.abs(volts).max()
    sudden = (most > SUDDEN * (volts.max(0) - volts.min(0))) & (most > SMALL * largest)
    return jnp.where(sudden, most, 0.0).max() / jnp.maximum(largest, 1e-300)


@custom_jvp
def without_derivative(x: Array, jumped: Array) -> Array:
    """Returns x. Its derivative is NaN if the voltage has jumped."""
    return x


@without_derivative.defjvp
def _without_derivative_jvp(primals, tangents):
    (x, jumped), moved = primals, tangents[0]
    return without_derivative(x, jumped), jnp.where(jumped, jnp.nan, 1.0) * moved


DERIVATIVE = (
    "The voltage of `voltage_law` jumps within a step: a derivative of this run is refused, because it "
    "lacks that of the instant of the jump (round the jump off, or give the law a `period`)."
)
"""The sentence that refuses a derivative."""


def jump_warning(jump: float | None) -> str:
    """Returns the warning about a run in which a voltage jumped by this part of the largest one; empty if
    none did, or if none is looked for."""
    if jump is None or not jump > 0.0:
        return ""
    return (
        f"The voltage of `voltage_law` jumps within steps, by up to {100.0 * jump:.2g} % of the largest: "
        "the motion is right to its tolerance with error control only, and derivatives of it are refused."
    )
