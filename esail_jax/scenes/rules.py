"""Rules for the values of a scene, the types of these values, and the messages that a user reads when a
value breaks a rule.

Every message reads: `key` must ..., but is ... . The aliases of types are the annotations of the tables'
fields: what a key may be given. `Shape` and `Kind` are their counterparts for the checks at run time.
"""

import bisect
import dataclasses
import datetime
import enum
import math
import sys
import typing
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from esail_jax.errors import SceneError


@runtime_checkable
class SupportsArray(Protocol):
    """An array of NumPy or JAX, traced or not. A scene is read and checked without importing JAX, which
    takes longer than the rest."""

    def __array__(self) -> np.ndarray: ...


Number = float | SupportsArray
"""One number: an int, a float, or an array of shape ()."""


NumberList = Sequence[float] | SupportsArray
"""A list, tuple or array of numbers."""


PerMember = Number | NumberList
"""One number for all members (tethers or rods), or a list with one number per member."""


Series = Number | NumberList
"""One number, or a list with one number per instant."""


Vector = NumberList
"""Three numbers: x, y, z."""


Vectors = NumberList | Sequence[NumberList]
"""One vector for all members, or a list with one vector per member."""


Matrix = SupportsArray | Sequence[NumberList]
"""Three rows of three numbers."""


Grid = NumberList | Sequence[NumberList]
"""A list with one number per row, or a list of rows with one number per member."""


History = NumberList | Sequence[NumberList] | Number
"""One number, a list with one number per member, or a list with one of these per instant."""


class Shape(enum.Enum):
    """How many numbers a key takes. *Members* are the tethers of a sail or the rods of a chain."""

    SCALAR = "number"
    """One number."""

    MEMBER = "number, or list with one number per member"
    """One number for all members, or a list with one number per member."""

    VECTOR = "list of three numbers"
    """Three numbers: x, y, z."""

    VECTORS = "list of three numbers, or list with one such list per member"
    """One vector for all members, or a list with one vector per member."""

    MATRIX = "list of three lists of three numbers"
    """A tensor: three rows of three numbers."""

    LIST = "list of numbers"
    """A list of any length."""

    SERIES = "number, or list of numbers"
    """One number, or a list of any length."""

    GRID = "list of numbers, or list of lists with one number per member"
    """A list with one number per row, or a list of rows with one number per member."""

    HISTORY = "number, or list with one number per member, or list with one of these per instant"
    """One number, a list with one number per member, or a list with one of these per instant. Whether a
    list of numbers belongs to members or instants, other keys tell."""


class Kind(enum.Enum):
    """What sort of value a key takes."""

    NUMBER = "number"
    """Real numbers: the only kind that may be a JAX array."""

    INTEGER = "integer"
    """Positive integers."""

    CHOICE = "choice"
    """One of a few names."""

    SWITCH = "switch"
    """True or false."""

    DATE = "date"
    """An instant of the calendar, as a text."""


def is_traced(value: Any) -> bool:
    """Tells whether a value is a tracer: a number under `jit`, `grad` or `vmap`."""
    return "jax" in sys.modules and isinstance(value, sys.modules["jax"].core.Tracer)


def is_jax_array(value: Any) -> bool:
    """Tells whether a value is a JAX array, traced or not."""
    return "jax" in sys.modules and isinstance(value, sys.modules["jax"].Array)


@dataclasses.dataclass(frozen=True)
class Members:
    """The tethers of a sail or the rods of a chain: their number, what one of them is called, and the key
    that gives the number."""

    count: int
    name: str
    key: str


@dataclasses.dataclass(frozen=True)
class Rule:
    """Check of one key.

    must: the condition, as a message words it; accepts: tells whether an array of finite numbers satisfies
    it; structure: the value decides which program is compiled, or which instants it saves, and cannot be
    traced; choices: the names to choose from; low, high: the least and the largest number, of which the
    condition may exclude the ends."""

    must: str
    accepts: Callable[[Any], bool] = lambda value: True
    shape: Shape = Shape.SCALAR
    structure: bool = False
    kind: Kind = Kind.NUMBER
    choices: tuple[str, ...] = ()
    low: float = -math.inf
    high: float = math.inf


positive = Rule("be positive", lambda x: bool((x > 0).all()), low=0.0)


non_negative = Rule("not be negative", lambda x: bool((x >= 0).all()), low=0.0)


non_positive = Rule("not be positive", lambda x: bool((x <= 0).all()), high=0.0)


nonzero_vector = Rule("not be zero", lambda x: bool((np.linalg.norm(x, axis=-1) > 0).all()))


any_number = Rule("be a finite number")


increasing = Rule("increase", lambda x: x.ndim == 1 and bool((np.diff(x) > 0).all()))


positive_integer = Rule("be a positive integer", structure=True, kind=Kind.INTEGER)


true_or_false = Rule("be true or false", structure=True, kind=Kind.SWITCH)


date = Rule("be a date", structure=True, kind=Kind.DATE)


def between(interval: str) -> Rule:
    """Rule for numbers of an interval such as "(-180, 180]": a square bracket includes the end, a round one
    excludes it."""
    low, high = (float(end) for end in interval[1:-1].split(","))
    above = np.greater_equal if interval.startswith("[") else np.greater
    below = np.less_equal if interval.endswith("]") else np.less
    inside = lambda x: bool((above(x, low) & below(x, high)).all())  # noqa: E731
    return Rule(f"lie in {interval}", inside, low=low, high=high)


def choice(names: Any) -> Rule:
    """Rule for one of several names. names: a `Literal` type, the annotation of the key."""
    names = typing.get_args(names)
    quoted = [f'"{name}"' for name in names]
    listed = " or ".join([", ".join(quoted[:-1]), quoted[-1]] if len(quoted) > 1 else quoted)
    return Rule(f"be {listed}", structure=True, kind=Kind.CHOICE, choices=names)


def describe(value: Any) -> str:
    """Words a value for the end of a message, `is ...`, in at most about sixty characters."""
    if is_traced(value):
        return "is a traced value"
    kind = getattr(getattr(value, "dtype", None), "kind", "f")
    if kind not in "biuf" and np.ndim(value):  # its numbers would look like those that are taken
        return f"is an array of dtype {value.dtype}"
    text = repr(value.tolist() if hasattr(value, "tolist") else value)
    text = {"True": "true", "False": "false"}.get(text, text)
    return f"is {text if len(text) <= 60 else text[:57] + '...'}"


def describe_fault(value: Any, array: np.ndarray, accepts: Callable[[np.ndarray], bool]) -> str:
    """Words a value that breaks a rule, as `describe` does, or the first entry of a long list up to which
    it does: `is -3.0 at index 499`."""
    text = describe(value)
    if not text.endswith("...") or array.ndim == 0:
        return text
    # What holds for the first entries holds for fewer of them.
    index = bisect.bisect_left(range(len(array)), True, key=lambda i: not accepts(array[: i + 1]))
    return f"{describe(array[index])} at index {index}"


def check_value(key: str, value: Any, rule: Rule, members: Members | None) -> Any:
    """Checks a value and returns it in the form that the scene stores: a float, a tuple of floats, or a JAX
    array.

    Raises SceneError. Only the shape of a traced number is checked: it has no value yet.
    """
    value = plain(value)
    if is_traced(value):
        if rule.structure:
            raise SceneError(key, "be a plain Python value: it is structure", "is a traced value")
        if np.dtype(value.dtype).kind not in "fiu":
            must = "be a number" + with_member(FORMS[rule.shape].numbers, members)
            raise SceneError(key, must, f"is a traced value of dtype {value.dtype}")
        return check_shape(key, as_float64(value), rule, members)
    if rule.shape is Shape.LIST and rule.kind is Kind.INTEGER:
        if not isinstance(value, (list, tuple)):
            raise SceneError(key, "be a list of integers", describe(value))
        one = dataclasses.replace(rule, shape=Shape.SCALAR)
        return tuple(check_value(key, item, one, members) for item in value)
    if rule.kind is Kind.SWITCH:
        if not isinstance(value, bool):
            raise SceneError(key, rule.must, describe(value))
        return value
    if rule.kind is Kind.CHOICE:
        if not isinstance(value, str) or value not in rule.choices:
            raise SceneError(key, rule.must, describe(value))
        return value
    if rule.kind is Kind.DATE:
        return check_date(key, value)
    if rule.kind is Kind.INTEGER:
        if isinstance(value, bool) or not isinstance(value, int) or value < 1:
            raise SceneError(key, rule.must, describe(value))
        if value > MOST_COUNT:
            raise SceneError(key, f"be at most {MOST_COUNT:.0e}", describe(value))
        return value
    return check_number(key, value, rule, members)


def check_date(key: str, value: Any) -> str:
    """The text of a date. A date of TOML, which has no quotes, becomes its text. Raises SceneError."""
    from esail_jax.calendar.instants import MUST, read_instant  # takes a tenth of a second to import

    if isinstance(value, datetime.datetime | datetime.date):
        value = value.isoformat().replace("+00:00", "Z")
    if not isinstance(value, str):
        raise SceneError(key, MUST, describe(value))
    read_instant(value, key)
    return value.strip()


MOST_COUNT = 10**30
"""Largest number of parts, more than any machine holds. Integers have no largest one."""


def check_number(key: str, value: Any, rule: Rule, members: Members | None) -> Any:
    """Checks one or several real numbers: their shape, that they are finite, and the rule's condition.

    Raises SceneError."""
    array = numbers_of(key, value)
    if array is None and isinstance(value, int) and not isinstance(value, bool):
        raise SceneError(key, "be a number below 1e308", describe(value))
    if array is None or array.size == 0:
        must = "be a number" + with_member(FORMS[rule.shape].numbers, members)
        raise SceneError(key, must, describe(value))
    check_shape(key, array, rule, members)
    if not np.isfinite(array).all():
        raise SceneError(key, "be finite", describe_fault(value, array, lambda x: np.isfinite(x).all()))
    if not rule.accepts(array):
        raise SceneError(key, rule.must, describe_fault(value, array, rule.accepts))
    if is_jax_array(value) and not rule.structure:
        return as_float64(value)
    return float(array) if array.ndim == 0 else to_tuple(array)


def plain(value: Any) -> Any:
    """A value in plain form, where another type has the same meaning: numbers and truth values of
    NumPy, names in its strings, arrays without axes, and lists with traced numbers, which become one traced
    array."""
    if is_traced(value):
        return value
    if isinstance(value, np.generic) or (hasattr(value, "dtype") and np.shape(value) == ()):
        kind = np.dtype(value.dtype).kind
        return value.item() if kind in "biuUO" else value
    return joined(value) if has_traced(value) else value


def has_traced(value: Any) -> bool:
    """Tells whether a traced number stands in a list, or in lists of a list."""
    if isinstance(value, (list, tuple)):
        return any(map(has_traced, value))
    return is_traced(value)


def joined(value: Any) -> Any:
    """numbers, or lists of equally many of them, as one traced array. What is no number, or does
    not fit together, stays a list, which the checks refuse."""
    numpy = sys.modules["jax"].numpy
    try:
        if isinstance(value, (list, tuple)):
            return numpy.stack([joined(x) for x in value])
        return value if numbers_of("", value) is None else numpy.asarray(value, float)
    except (TypeError, ValueError):
        return value


def as_float64(value: Any) -> Any:
    """An array of JAX, traced or not, as one of float64, unless JAX is set to 32 bit, which a run
    refuses."""
    known = value.dtype == np.float64 or not sys.modules["jax"].config.jax_enable_x64
    return value if known else value.astype(np.float64)


def numbers_of(key: str, value: Any) -> np.ndarray | None:
    """Real numbers as an array of float64, by position and not by label. Returns None if they are
    something else. Raises SceneError for masked numbers: a mask is no number, and the one below it is not
    meant."""
    if np.ma.is_masked(value):
        raise SceneError(key, "hold no masked numbers", f"has {np.ma.count_masked(value)}")
    if is_jax_array(value) and str(value.dtype) == "bfloat16":  # no type of NumPy
        value = value.astype("float32")
    try:
        whole = isinstance(value, int) and not isinstance(value, bool)
        array = np.asarray(float(value) if whole else value)
    except (TypeError, ValueError, OverflowError):
        return None
    return None if array.dtype.kind not in "iuf" or has_boolean(value) else array.astype(float)


def to_tuple(array: np.ndarray) -> tuple:
    """The numbers of an array as nested tuples, which are hashable and immutable."""
    return tuple(to_tuple(row) for row in array) if array.ndim > 1 else tuple(array.tolist())


def has_boolean(value: Any) -> bool:
    """Tells whether true or false stands among the numbers; NumPy would take it for 1 or 0."""
    if isinstance(value, (list, tuple)):
        return any(has_boolean(item) for item in value)
    return isinstance(value, (bool, np.bool_))


def known(value: Any) -> np.ndarray | None:
    """The numbers of a checked value; None if it is traced, as it then has no value yet."""
    return None if is_traced(value) else np.asarray(value)


class Form(NamedTuple):
    """What the value of a key with some shape is.

    must: the condition, as a message words it; fits: tells whether the shape of an array is right, whatever
    the number of members; numbers: what follows `must be a number` in the message on a value that holds
    something else than numbers. `{member}` stands for what a member is called."""

    must: str
    fits: Callable[[tuple[int, ...]], bool]
    numbers: str = ""


FORMS = {
    Shape.SCALAR: Form("be a single number", lambda shape: shape == ()),
    Shape.MEMBER: Form(
        "be a number or a list with one per {member}",
        lambda shape: len(shape) <= 1,
        " or a list with one per {member}",
    ),
    Shape.VECTOR: Form("be a list of three numbers", lambda shape: shape == (3,), " for each of x, y, z"),
    Shape.VECTORS: Form(
        "be a list of three numbers, or of one such list per {member}",
        lambda shape: len(shape) in (1, 2) and shape[-1] == 3,
        " for each of x, y, z",
    ),
    Shape.MATRIX: Form(
        "be a list of three lists of three numbers",
        lambda shape: shape == (3, 3),
        " for each entry of a 3 x 3 tensor",
    ),
    Shape.LIST: Form("be a list of numbers", lambda shape: len(shape) == 1),
    Shape.SERIES: Form(
        "be a number or a list of numbers", lambda shape: len(shape) <= 1, " or a list of numbers"
    ),
    Shape.GRID: Form(
        "be a list of numbers, or of such lists",
        lambda shape: len(shape) in (1, 2),
        " or a list of numbers",
    ),
    Shape.HISTORY: Form(
        "be a number, a list of numbers, or a list of lists",
        lambda shape: len(shape) <= 2,
        " or a list of numbers",
    ),
}
"""What a value is, by shape."""


class Counted(NamedTuple):
    """The axis of a value that has one entry per member.

    axes: number of axes of a value with such an axis; axis: which of them it is; must, got: a message on
    another number of entries, before and with that number."""

    axes: int
    axis: int
    must: str
    got: str


COUNTED = {
    Shape.MEMBER: Counted(1, 0, "be a number or a list of", "has {size} entries"),
    Shape.VECTORS: Counted(2, 0, "be a vector or a list of", "has {size} entries"),
    Shape.GRID: Counted(2, 1, "have lists of", "has lists of {size}"),
}
"""The axis of the members, for the shapes that have one. (Whether that of a history is one, other keys
tell.)"""


def with_member(text: str, members: Members | None) -> str:
    """A text of `FORMS` with the name of a member."""
    return text.format(member="tether" if members is None else members.name)


def check_shape(key: str, value: Any, rule: Rule, members: Members | None) -> Any:
    """The value if its shape is what the rule asks for. Raises SceneError otherwise."""
    shape, form, counted = np.shape(value), FORMS[rule.shape], COUNTED.get(rule.shape)
    if not form.fits(shape):
        raise SceneError(key, with_member(form.must, members), wrong_shape(value))
    if members is not None and counted is not None and len(shape) == counted.axes:
        size = shape[counted.axis]
        if size != members.count:
            must = f"{counted.must} {members.count} (`{members.key}`)"
            raise SceneError(key, must, counted.got.format(size=size))
    return value


def wrong_shape(value: Any) -> str:
    """Words a value of the wrong shape for the end of a message; of a traced value only the shape is
    known."""
    traced = is_traced(value)
    return f"is traced, of shape {np.shape(value)}" if traced else describe(value)


def count_of(number: int, name: str) -> str:
    """A number of things in words: `1 rod`, `2 rods`."""
    return f"{number} {name}" + "s" * (number != 1)


def check_list(key: str, time: Any) -> None:
    """Refuses a single traced number in place of a list of instants; of other values the rule has seen the
    shape. Raises SceneError."""
    if np.ndim(time) == 0:
        raise SceneError(key, "increase", wrong_shape(time))
