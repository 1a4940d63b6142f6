"""What a scene key may hold, and the one line a user reads when it holds something else.

Every message reads: `key` must be ..., but is ... .
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import numpy as np


class SceneError(ValueError):
    """A scene that cannot be built; the message names the key, what it must be and what it is."""

    def __init__(self, key: str, must: str, got: str):
        super().__init__(f"`{key}` must {must}, but {got}")
        self.key, self.must, self.got = key, must, got


@dataclasses.dataclass(frozen=True)
class Members:
    """What there may be one number for each of: how many, their name, and the key that says so."""

    count: int
    name: str
    key: str


@dataclasses.dataclass(frozen=True)
class Rule:
    """Check of one key. `accepts(array)` gets finite numbers."""

    must: str
    accepts: Callable[[Any], bool] = lambda value: True
    shape: str = "scalar"  # or "member": one number or one per tether (or rod); "vector": three
    # numbers; "vectors": three, or three per rod; "list": as many as wanted; "series": one number or a
    # list; "grid": a list, or one of lists with one number per tether
    structure: bool = False  # recompiles, takes no tracer
    kind: str = "number"  # or "integer", "choice", "switch"
    choices: tuple[str, ...] = ()


def rule_of(field: dataclasses.Field) -> Rule:
    """The rule a dataclass field was declared with."""
    return field.metadata["rule"]


def declare(rule: Rule, default: Any = dataclasses.MISSING) -> Any:
    """A dataclass field with its rule; without a default the key must be given."""
    if default is dataclasses.MISSING:
        return dataclasses.field(metadata={"rule": rule})
    return dataclasses.field(default=default, metadata={"rule": rule})


def positive(shape: str = "scalar", structure: bool = False) -> Rule:
    return Rule("be positive", lambda x: bool((x > 0).all()), shape, structure)


def nonzero_vectors() -> Rule:
    return Rule("not be zero", lambda x: bool((np.linalg.norm(x, axis=-1) > 0).all()), "vectors")


def non_negative(shape: str = "scalar") -> Rule:
    return Rule("not be negative", lambda x: bool((x >= 0).all()), shape)


def any_number(shape: str = "scalar") -> Rule:
    return Rule("be a finite number", lambda x: True, shape)


def increasing() -> Rule:
    return Rule("increase", lambda x: x.ndim == 1 and bool((np.diff(x) > 0).all()), "series")


def listed(rule: Rule) -> Rule:
    """Of a table that may stand in a file several times: one value for each."""
    return dataclasses.replace(rule, shape="list", structure=True)


def between(must: str, accepts: Callable[[Any], bool]) -> Rule:
    return Rule(must, accepts)


def choice(*names: str) -> Rule:
    listed = ", ".join(f'"{name}"' for name in names[:-1]) + f' or "{names[-1]}"'
    listed = f'"{names[0]}"' if len(names) == 1 else listed
    return Rule(f"be {listed}", structure=True, kind="choice", choices=names)


def count() -> Rule:
    return Rule("be a positive integer", structure=True, kind="integer")


def switch() -> Rule:
    return Rule("be true or false", structure=True, kind="switch")


def describe(value: Any) -> str:
    """`is ...` of a message, short."""
    if isinstance(value, jax.core.Tracer):
        return "is a traced value"
    text = repr(value.tolist() if hasattr(value, "tolist") else value)
    text = {"True": "true", "False": "false"}.get(text, text)
    return f"is {text if len(text) <= 60 else text[:57] + '...'}"


def check_value(key: str, value: Any, rule: Rule, members: Members | None) -> Any:
    """`value` in the form the scene keeps (numbers as float, tuple of floats, or JAX array).

    Raises SceneError. Tracers of physical numbers pass unchecked: they have no value yet.
    """
    if isinstance(value, jax.core.Tracer):
        if rule.structure:
            raise SceneError(key, "be a plain Python value: it is structure", "is a traced value")
        return check_shape(key, value, rule, members)
    if rule.shape == "list" and rule.kind == "integer":
        if not isinstance(value, (list, tuple)):
            raise SceneError(key, "be a list of integers", describe(value))
        one = dataclasses.replace(rule, shape="scalar")
        return tuple(check_value(key, item, one, members) for item in value)
    if rule.kind == "switch":
        if not isinstance(value, bool):
            raise SceneError(key, rule.must, describe(value))
        return value
    if rule.kind == "choice":
        if not isinstance(value, str) or value not in rule.choices:
            raise SceneError(key, rule.must, describe(value))
        return value
    if rule.kind == "integer":
        if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
            raise SceneError(key, rule.must, describe(value))
        return int(value)
    return check_number(key, value, rule, members)


def check_number(key: str, value: Any, rule: Rule, members: Members | None) -> Any:
    """A finite real number, or as many as the rule's shape wants."""
    try:
        array = np.asarray(value)
        numeric = array.dtype.kind in "iuf"
        array = array.astype(float) if numeric else array
    except (TypeError, ValueError):
        numeric = False
    if not numeric or array.size == 0 or has_switch(value):
        raise SceneError(key, "be a number" + plural(rule, members), describe(value))
    check_shape(key, array, rule, members)
    if not np.isfinite(array).all():
        raise SceneError(key, "be finite", describe(value))
    if not rule.accepts(array):
        raise SceneError(key, rule.must, describe(value))
    if isinstance(value, jax.Array) and not rule.structure:
        return value
    return float(array) if array.ndim == 0 else to_tuple(array)


def to_tuple(array: np.ndarray) -> tuple:
    """Nested tuples of an array's numbers: hashable and immutable."""
    return tuple(to_tuple(row) for row in array) if array.ndim > 1 else tuple(array.tolist())


def has_switch(value: Any) -> bool:
    """Is there a true or false among the numbers? NumPy would count it as 1 or 0."""
    if isinstance(value, (list, tuple)):
        return any(has_switch(item) for item in value)
    return isinstance(value, (bool, np.bool_))


def known(value: Any) -> np.ndarray | None:
    """The numbers of a checked value, None for a tracer."""
    return None if isinstance(value, jax.core.Tracer) else np.asarray(value)


def plural(rule: Rule, members: Members | None) -> str:
    if rule.shape in ("vector", "vectors"):
        return " for each of x, y, z"
    if rule.shape in ("series", "grid"):
        return " or a list of numbers"
    name = "tether" if members is None else members.name
    return f" or a list with one per {name}" if rule.shape == "member" else ""


def check_shape(key: str, value: Any, rule: Rule, members: Members | None) -> Any:
    """Raise unless the shape fits: (), (p,) where allowed, (3,) for a vector, or (p, 3)."""
    shape = np.shape(value)
    if rule.shape == "vector":
        if shape != (3,):
            raise SceneError(key, "be a list of three numbers", wrong_shape(value))
    elif rule.shape == "list":
        if len(shape) != 1:
            raise SceneError(key, "be a list of numbers", wrong_shape(value))
    elif rule.shape == "series":
        if len(shape) > 1:
            raise SceneError(key, "be a number or a list of numbers", wrong_shape(value))
    elif rule.shape == "grid":
        if len(shape) not in (1, 2):
            raise SceneError(key, "be a list of numbers, or of such lists", wrong_shape(value))
        if len(shape) == 2 and members is not None and shape[1] != members.count:
            must = f"have lists of {members.count} (`{members.key}`)"
            raise SceneError(key, must, f"has lists of {shape[1]}")
    elif rule.shape == "vectors":
        if shape != (3,) and (len(shape) != 2 or shape[1] != 3):
            must = f"be a list of three numbers, or of one such list per {members.name}"
            raise SceneError(key, must, wrong_shape(value))
        if len(shape) == 2 and shape[0] != members.count:
            must = f"be a vector or a list of {members.count} (`{members.key}`)"
            raise SceneError(key, must, f"has {shape[0]} entries")
    elif rule.shape == "member" and len(shape) == 1:
        if members is not None and shape[0] != members.count:
            raise SceneError(
                key,
                f"be a number or a list of {members.count} (`{members.key}`)",
                f"has {shape[0]} entries",
            )
    elif shape != ():
        must = "be a number" + plural(rule, members) if rule.shape == "member" else "be a single number"
        raise SceneError(key, must, wrong_shape(value))
    return value


def wrong_shape(value: Any) -> str:
    """`is ...` or, for a tracer, `has ...` of a message."""
    traced = isinstance(value, jax.core.Tracer)
    return f"is traced, of shape {np.shape(value)}" if traced else describe(value)
