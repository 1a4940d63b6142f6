"""Distributions of the numbers that members of an ensemble draw."""

import abc
import dataclasses
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from scipy.special import ndtri

from esail_jax.array_types import Float
from esail_jax.scenes.rules import SceneError

UnitPoints = Float[np.ndarray, "member column"]
"""Numbers in (0, 1), one row per member and one column per number that a member draws."""

Real = int | float | np.integer | np.floating


@dataclasses.dataclass(frozen=True)
class Distribution(abc.ABC):
    """A distribution of one scene key, or of one key per tether.

    A subclass declares its parameters as fields and `per_tether` as the last field: draw one number for
    each tether (or rod) instead of one for all. Raises SceneError for parameters that are no finite numbers
    or do not fit together."""

    form: ClassVar[str]
    """Name on the command line."""

    if TYPE_CHECKING:  # a field of every subclass

        @property
        def per_tether(self) -> bool: ...

    def __post_init__(self):
        for name in self.parameter_names():
            object.__setattr__(self, name, self._number(name))
        if not isinstance(self.per_tether, bool):
            raise self._error("have true or false as per_tether", "per_tether")
        self.check()

    @classmethod
    def parameter_names(cls) -> tuple[str, ...]:
        """Names of the parameters, in the order of the command line."""
        return tuple(field.name for field in dataclasses.fields(cls) if field.name != "per_tether")

    @property
    def text(self) -> str:
        """The distribution as on the command line, such as `uniform:1.0:2.0`."""
        numbers = (repr(float(getattr(self, name))) for name in self.parameter_names())
        return ":".join([self.form, *numbers])

    @abc.abstractmethod
    def check(self) -> None:
        """Raises SceneError if the parameters do not fit together."""

    def _number(self, name: str) -> float:
        value = getattr(self, name)
        try:
            number = float("nan") if isinstance(value, (bool, str)) else float(value)
        except (TypeError, ValueError):
            number = float("nan")
        if not math.isfinite(number):
            raise self._error("have finite numbers", name)
        return number

    def _error(self, must: str, *names: str) -> SceneError:
        values = " and ".join(f"{name} = {getattr(self, name)!r}" for name in names)
        return SceneError(type(self).__name__, must, f"has {values}")


@dataclasses.dataclass(frozen=True)
class Uniform(Distribution):
    """The uniform distribution between a and b, a <= b."""

    a: Real
    b: Real
    per_tether: bool = False
    form: ClassVar[str] = "uniform"

    def check(self) -> None:
        """Raises SceneError if b < a."""
        if self.b < self.a:
            raise self._error("have a <= b", "a", "b")

    def values(self, u: UnitPoints) -> UnitPoints:
        """The values whose cumulative probabilities are u."""
        return self.a + (self.b - self.a) * u


@dataclasses.dataclass(frozen=True)
class Normal(Distribution):
    """The normal distribution with a mean and a standard deviation sd >= 0."""

    mean: Real
    sd: Real
    per_tether: bool = False
    form: ClassVar[str] = "normal"

    def check(self) -> None:
        """Raises SceneError if the standard deviation is negative."""
        if self.sd < 0.0:
            raise self._error("have sd >= 0", "sd")

    def values(self, u: UnitPoints) -> UnitPoints:
        """The values whose cumulative probabilities are u."""
        return self.mean + self.sd * ndtri(u)


@dataclasses.dataclass(frozen=True)
class LogNormal(Distribution):
    """The distribution of median exp(sigma z), z standard normal: always positive. median > 0, sigma >= 0,
    which is about the relative standard deviation if it is small."""

    median: Real
    sigma: Real
    per_tether: bool = False
    form: ClassVar[str] = "lognormal"

    def check(self) -> None:
        """Raises SceneError if the median is not positive or sigma is negative."""
        if self.median <= 0.0 or self.sigma < 0.0:
            raise self._error("have median > 0 and sigma >= 0", "median", "sigma")

    def values(self, u: UnitPoints) -> UnitPoints:
        """The values whose cumulative probabilities are u."""
        return self.median * np.exp(self.sigma * ndtri(u))


@dataclasses.dataclass(frozen=True)
class Grid(Distribution):
    """n equidistant numbers from a to b, without chance.

    Several grids form all their combinations, of which the last grid varies fastest. Members beyond the
    last combination begin again with the first one."""

    a: Real
    b: Real
    n: Real
    per_tether: bool = False
    form: ClassVar[str] = "grid"

    def check(self) -> None:
        """Raises SceneError if n is no positive integer."""
        if self.n < 1 or self.n != int(self.n):
            raise self._error("have a positive integer n", "n")
        object.__setattr__(self, "n", int(self.n))

    def points(self) -> Float[np.ndarray, " point"]:
        """The numbers of the grid."""
        return np.linspace(float(self.a), float(self.b), int(self.n))


FORMS: dict[str, type[Distribution]] = {kind.form: kind for kind in (Uniform, Normal, LogNormal, Grid)}
"""Distributions by their name on the command line."""


def parse_distribution(text: str, per_tether: bool = False) -> Distribution:
    """Reads `uniform:a:b`, `normal:mean:sd`, `lognormal:median:sigma` or `grid:a:b:n`.

    Raises SceneError with the key "distribution"."""
    form, *numbers = text.strip().split(":")
    if form not in FORMS:
        known = ", ".join(form_of(kind) for kind in FORMS.values())
        raise SceneError("distribution", f"look like one of {known}", f"is {text!r}")
    kind = FORMS[form]
    try:
        values = [float(x) for x in numbers]
    except ValueError:
        values = []
    if len(values) != len(kind.parameter_names()) or not all(map(math.isfinite, values)):
        raise SceneError("distribution", f"be {form_of(kind)} with finite numbers", f"is {text.strip()}")
    made: Callable[..., Distribution] = kind
    try:
        return made(*values, per_tether=per_tether)
    except SceneError as error:
        raise SceneError("distribution", error.must, f"is {text.strip()}") from None


def form_of(kind: type[Distribution]) -> str:
    """The form of a distribution on the command line, such as `uniform:a:b`."""
    return ":".join([kind.form, *kind.parameter_names()])


def as_distribution(value: Any, per_tether: bool = False) -> Distribution:
    """A distribution from an object or from its text. Raises SceneError."""
    if isinstance(value, str):
        return parse_distribution(value, per_tether)
    if not isinstance(value, Distribution):
        must = "be Uniform, Normal, LogNormal, Grid or a text such as 'uniform:1:2'"
        raise SceneError("distribution", must, f"is {value!r}")
    change: dict[str, Any] = {"per_tether": True}
    return dataclasses.replace(value, **change) if per_tether else value
