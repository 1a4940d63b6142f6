"""Calls of the methods of a voltage law, or of a term, that a user wrote, with errors that say what is
wrong in it.

A law is traced: JAX calls its methods once, with placeholders for the numbers of a state.
"""

import traceback
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import numpy as np

from esail_jax.errors import InputError, SceneError, nearest
from esail_jax.measurements import Measurements

NAMES = (*Measurements._fields, "sun", "root_phase", "tether_phase", "outward_from")
"""What a law can measure."""

NEEDED = {
    "voltage": "a voltage law with a `period`",
    "position": "[orbit]",
    "momentum_axis": "[hub]",
    "current": "`tethers.wire_radius`",
    "deployed_length": "[deployment]",
    "payout_rate": "[deployment]",
    "heliocentric_position": "[orbit]",
    "r_xx": "`depends_on` of the term to name it",
    "normal_squared": "`tethers.bending`",
}
"""What a measurement needs that is None otherwise."""

LIBRARIES = (
    *(str(Path(file).parent) for file in (jax.__file__, eqx.__file__, np.__file__)),
    str(Path(__file__).parents[1]),
)
"""Folders whose lines are not those of a user's law."""


def commanded(law: Any, measurements: Measurements) -> Any:
    """What a law without a memory returns: the voltages. Raises SceneError."""
    return called(law, "commanded", measurements)


def first_memory(law: Any, measurements: Measurements) -> Any:
    """The memory of a law at the start; None for a law without one. Raises SceneError."""
    return called(law, "init", measurements) if hasattr(law, "update") else None


def updated(law: Any, measurements: Measurements, memory: Any) -> tuple[Any, Any]:
    """The voltages and the next memory, None for a law without one. Raises SceneError."""
    if not hasattr(law, "update"):
        return commanded(law, measurements), None
    return two_things(called(law, "update", measurements, memory), "voltage_law", "voltages")


def two_things(returned: Any, subject: str, what: str) -> tuple[Any, Any]:
    """What the method `update` of a law returned, as two things. subject: what the law is called; what: the
    first of the two. Raises SceneError."""
    if not isinstance(returned, tuple | list) or len(returned) != 2:
        many = f" of {len(returned)}" if isinstance(returned, tuple | list) else ""
        must = f"return two things, the {what} and the next memory"
        raise SceneError(f"{subject}.update", must, f"returned a {type(returned).__name__}{many}")
    first, after = returned
    return first, after


def called(law: Any, method: str, *given: Any, subject: str = "voltage_law", own: bool = False) -> Any:
    """What a method of a law or of another object that a user wrote returns. subject: what it is called in
    errors; own: whether any error of the method is one of the input.

    Raises SceneError for a name that is no measurement, for the use of a measurement that the sail does not
    have, and for what JAX cannot trace. Other errors of the method stay as they are."""
    named = [x for x in given if hasattr(x, "_fields")]
    method_name = f"{subject}.{method}"
    try:
        return getattr(law, method)(*given)
    except InputError:
        raise
    except (jax.errors.JAXTypeError, jax.errors.JAXIndexError) as error:
        must = "use `jnp.where` in place of `if`, and `jax.numpy` in place of numpy and `float`"
        raise refused(method_name, must, error) from error
    except (AttributeError, TypeError) as error:
        name, asked = getattr(error, "name", None), getattr(error, "obj", None)
        if name is not None and any(asked is x for x in named):
            what, names = names_in(asked)
            hint = nearest(name, names) or f"; there are {', '.join(names)}"
            got = f"{place_of(error)} uses `{name}`{hint}"
            raise SceneError(method_name, f"use {what} that exist", got) from error
        absent = [name for x in named for name in x._fields if getattr(x, name) is None]
        absent = [name for name in absent if own or name != "current"]
        if "NoneType" not in str(error) or not absent:
            if own:
                raise refused(method_name, "be a function that JAX can trace", error) from error
            raise
        listed = ", ".join(f"`{x}`" + (f" (needs {NEEDED[x]})" if x in NEEDED else "") for x in absent)
        what = names_in(named[0])[0]
        raise refused(method_name, f"not use {what} that are None here, {listed}", error) from error
    except Exception as error:
        if own:
            raise refused(method_name, "be a function that JAX can trace", error) from error
        raise


def names_in(given: Any) -> tuple[str, tuple[str, ...]]:
    """What the fields of an argument are, in words, and their names."""
    if isinstance(given, Measurements):
        return "measurements", NAMES
    return "fields", given._fields


def refused(method: str, must: str, error: Exception) -> SceneError:
    """The error of a method that JAX or Python raised, with the place in the user's file."""
    reason = type(error).__name__
    if not isinstance(error, jax.errors.JAXTypeError | jax.errors.JAXIndexError):
        reason += f": {' '.join(str(error).split())}"
    return SceneError(method, must, f"{place_of(error)} raises {reason}")


def place_of(error: Exception) -> str:
    """File and line in which an error arose, the last one outside the libraries that a law calls; `the
    call` if it did not get there."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [x for x in frames if not x.filename.startswith(LIBRARIES)]
    return f"{Path(own[-1].filename).name}:{own[-1].lineno}" if own else "the call"
