"""Calls of the methods of a voltage law that a user wrote, with errors that say what is wrong in the law.

A law is traced: JAX calls its methods once, with placeholders for the numbers of a state.
"""

import traceback
from pathlib import Path
from typing import Any

import equinox as eqx
import jax

from esail_jax.errors import InputError, nearest
from esail_jax.measurements import Measurements

NAMES = (*Measurements._fields, "sun", "root_phase", "tether_phase", "outward_from")
"""What a law can measure."""

NEEDED = {
    "voltage": "a law with a `period`",
    "position": "[orbit]",
    "momentum_axis": "[hub]",
}
"""What a measurement needs that is None otherwise."""

LIBRARIES = tuple(str(Path(module.__file__).parent) for module in (jax, eqx))
"""Folders whose lines are not those of a user's law."""


def commanded(law: Any, measurements: Measurements) -> Any:
    """What a law without a memory returns: the voltages. Raises InputError."""
    return called(law, "commanded", measurements)


def first_memory(law: Any, measurements: Measurements) -> Any:
    """The memory of a law at the start; None for a law without one. Raises InputError."""
    return called(law, "init", measurements) if hasattr(law, "update") else None


def updated(law: Any, measurements: Measurements, memory: Any) -> tuple[Any, Any]:
    """The voltages and the next memory, None for a law without one. Raises InputError."""
    if not hasattr(law, "update"):
        return commanded(law, measurements), None
    found = called(law, "update", measurements, memory)
    if not isinstance(found, tuple | list) or len(found) != 2:
        many = f" of {len(found)}" if isinstance(found, tuple | list) else ""
        must = "return two things, the voltages and the next memory"
        raise InputError(f"`voltage_law.update` must {must}, but returned a {type(found).__name__}{many}")
    volts, after = found
    return volts, after


def called(law: Any, method: str, measurements: Measurements, *more: Any) -> Any:
    """What a method of a law returns.

    Raises InputError for a name that is no measurement, for the use of a measurement that the sail does not
    have, and for what JAX cannot trace. Other errors of the method stay as they are."""
    try:
        return getattr(law, method)(measurements, *more)
    except (jax.errors.JAXTypeError, jax.errors.JAXIndexError) as error:
        must = "use `jnp.where` in place of `if`, and `jax.numpy` in place of numpy and `float`"
        raise refused(method, must, error) from error
    except (AttributeError, TypeError) as error:
        name = getattr(error, "name", None)
        if name is not None and isinstance(getattr(error, "obj", None), Measurements):
            hint = nearest(name, NAMES) or f"; there are {', '.join(NAMES)}"
            must, got = "use measurements that exist", f"{place_of(error)} uses `{name}`{hint}"
            raise InputError(f"`voltage_law.{method}` must {must}, but {got}") from error
        absent = [x for x in Measurements._fields if getattr(measurements, x, None) is None]
        if "NoneType" not in str(error) or not absent:
            raise
        listed = ", ".join(f"`{x}`" + (f" (needs {NEEDED[x]})" if x in NEEDED else "") for x in absent)
        raise refused(method, f"not use measurements that are None here, {listed}", error) from error


def refused(method: str, must: str, error: Exception) -> InputError:
    """The error of a method of a law that JAX or Python raised, with the place in the law."""
    reason = type(error).__name__
    if type(error) in (AttributeError, TypeError):
        reason += f": {' '.join(str(error).split())}"
    return InputError(f"`voltage_law.{method}` must {must}, but {place_of(error)} raises {reason}")


def place_of(error: Exception) -> str:
    """File and line in which an error arose, the last one outside the libraries that a law calls."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [x for x in frames if not x.filename.startswith(LIBRARIES)]
    return f"{Path(own[-1].filename).name}:{own[-1].lineno}"
