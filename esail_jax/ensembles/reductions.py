"""Numbers that stand for the history of an observable: its mean, its extremes, its last value.

An ensemble that keeps only these is as small as its inputs: a million members take megabytes, where their
histories would take hundreds of gigabytes.
"""

import importlib
from collections.abc import Callable, Sequence

import numpy as np

from esail_jax.array_types import Float
from esail_jax.errors import nearest
from esail_jax.scenes.rules import SceneError

Time = Float[np.ndarray, " time"]
Rows = Float[np.ndarray, "time *some"]
Row = Float[np.ndarray, "*some"] | np.float64  # a number of NumPy for an observable without axes

Reduction = Callable[[Time, Rows], Row]
"""A function (time [s], rows of one member) -> numbers, with the shape of one row."""


def mean(time: Time, rows: Rows) -> Row:
    """The mean over time, by the trapezoidal rule between the saved instants."""
    if len(time) == 1:
        return rows[0]
    return np.trapezoid(rows, time, axis=0) / (time[-1] - time[0])


def largest(_: Time, rows: Rows) -> Row:
    """The largest value at the saved instants."""
    return rows.max(0)


def least(_: Time, rows: Rows) -> Row:
    """The smallest value at the saved instants."""
    return rows.min(0)


def final(_: Time, rows: Rows) -> Row:
    """The value at the last saved instant."""
    return rows[-1]


REDUCTIONS: dict[str, Reduction] = {"mean": mean, "max": largest, "min": least, "final": final}
"""The reductions that have a name."""


def names_of(reduce: Sequence[str | Reduction]) -> tuple[str, ...]:
    """Names of reductions: of `REDUCTIONS`, or `module:function` for a function of a user, which every
    process imports.

    Raises SceneError for an unknown name, for a name that is given twice, and for a function that another
    process cannot import."""
    names = tuple(item if isinstance(item, str) else import_name(item) for item in reduce)
    shown = [name.rpartition(":")[2] for name in names]
    for name, short in zip(names, shown, strict=True):
        reduction_of(name)
        if shown.count(short) > 1:
            raise SceneError("reduce", "have each name once", f"has {short!r} twice")
    return names


def import_name(function: Reduction) -> str:
    """The name by which another process imports a function. Raises SceneError if it cannot."""
    module, name = (getattr(function, key, "") for key in ("__module__", "__qualname__"))
    if module in ("", "__main__") or not name.isidentifier():
        must = "have functions that other processes can import, from a module"
        raise SceneError("reduce", must, f"has {function!r}")
    return f"{module}:{name}"


def reduction_of(name: str) -> Reduction:
    """The reduction of a name. Raises SceneError."""
    module, colon, function = name.partition(":")
    if not colon:
        if name not in REDUCTIONS:
            must = f"have names among {', '.join(REDUCTIONS)}, or module:function"
            raise SceneError("reduce", must, f"has {name!r}{nearest(name, REDUCTIONS)}")
        return REDUCTIONS[name]
    try:
        found = getattr(importlib.import_module(module), function)
    except (ImportError, AttributeError, ValueError) as error:
        raise SceneError(
            "reduce", "have functions that can be imported", f"has {name!r}: {error}"
        ) from None
    if not callable(found):
        raise SceneError("reduce", "have functions that can be imported", f"has {name!r}, which is none")
    return found


def reduced_name(observable: str, reduction: str) -> str:
    """The name of a reduced observable, such as `coning_angle.mean`."""
    return f"{observable}.{reduction.rpartition(':')[2]}"


def reduced(
    time: Float[np.ndarray, " time"],
    rows: dict[str, Float[np.ndarray, "member time *some"]],
    names: Sequence[str],
) -> dict[str, Float[np.ndarray, "member *some"]]:
    """All observables, reduced by all reductions. Numbers of a member that failed are NaN where its history
    is, from the failure on: the mean, the extremes and the last value.

    Functions see rows that they cannot change. Raises SceneError for a function of a user that returns
    anything but real numbers in the shape of one instant."""
    found = {}
    for reduction in names:
        function = reduction_of(reduction)
        for name, values in rows.items():
            kept = values.view()
            kept.flags.writeable = False  # a function must not change what the next one sees
            each = [np.asarray(function(time, of_member)) for of_member in kept]
            for one in each:
                must = f"return real numbers in the shape {values.shape[2:]} of one instant of {name}"
                if one.dtype.kind not in "fiub":
                    raise SceneError(f"reduce {reduction}", must, f"returns {one.dtype}")
                if one.shape != values.shape[2:]:
                    raise SceneError(f"reduce {reduction}", must, f"returns {one.shape}")
            found[reduced_name(name, reduction)] = np.stack(each).astype(float)
    return found
