"""The parameters of a fit: numbers of a scene, and those of the instruments that have measured its run.

| name | what is free |
|---|---|
| `solar_wind.number_density` | a key whose value is one number |
| `tethers.length[*]` | every number of a key: those of tethers, or the components of a vector |
| `hub.inertia[1,2]` | one of them, counted from 1; of a tensor both entries that are equal |
| `bias.spin_rate[1]` | what an instrument shows too much, in the unit of the observable |
| `misalignment.angular_velocity_B[*]` | small rotation [rad] of an instrument against its axes |
"""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float
from esail_jax.constants import THRUST_FACTOR
from esail_jax.numerics.angles import rotation_by
from esail_jax.observables import described
from esail_jax.scenes.key_reference import rule_of_number, unit_of
from esail_jax.scenes.rules import Rule, SceneError, Shape, any_number, numbers_of
from esail_jax.scenes.scene import Scene

FREE = "free"
"""The argument with the names of parameters, in messages."""

BIAS, MISALIGNMENT = "bias", "misalignment"
"""What precedes the name of an observable in the name of a parameter of its instrument."""

NAMED = re.compile(r"(?P<key>\w+\.\w+)(?:\[(?P<place>\*|\d+(?:,\d+)*)\])?")

ABSENT: Mapping[str, Any] = {"solar_wind.thrust_factor": THRUST_FACTOR, "hub.torque": (0.0, 0.0, 0.0)}
"""Values of keys that a scene may leave out and that may be free nevertheless."""


class Parameter(NamedTuple):
    """One number of a fit. name: `KEY` or `KEY[i]`; key, place: the key and where in its value the number
    stands, an empty place for one number; start: its value at first; low, high: between which it must lie;
    unit: of it."""

    name: str
    key: str
    place: tuple[int, ...]
    start: float
    low: float
    high: float
    unit: str

    @property
    def of_instrument(self) -> bool:
        """Whether it is that of an instrument, and no number of the scene."""
        return self.key.partition(".")[0] in (BIAS, MISALIGNMENT)


def parameters_of(
    scene: Scene, free: Sequence[str], shapes: Mapping[str, tuple[int, ...]]
) -> list[Parameter]:
    """The parameters that names stand for. shapes: of the observables that are measured. Raises SceneError
    for names that are none, and for a number that is named twice."""
    if isinstance(free, str) or not len(free):
        raise SceneError(FREE, "be a list of keys", f"is {free!r}")
    found: dict[str, Parameter] = {}
    for name in free:
        for parameter in named(scene, name, shapes):
            if parameter.name in found:
                raise SceneError(FREE, "name every number once", f"has {parameter.name} twice")
            found[parameter.name] = parameter
    for one in found.values():
        if one.place and one.key in found:
            raise SceneError(FREE, "name every number once", f"has {one.key} and {one.name}")
    return list(found.values())


def named(scene: Scene, name: str, shapes: Mapping[str, tuple[int, ...]]) -> list[Parameter]:
    """The parameters that one name stands for."""
    parts = NAMED.fullmatch(name.strip())
    if parts is None:
        raise SceneError(FREE, "be keys such as tethers.length, KEY[2] or KEY[*]", f"has {name!r}")
    key, place = parts["key"], parts["place"]
    kind = key.partition(".")[0]
    if kind in (BIAS, MISALIGNMENT):
        value, unit = of_instrument(key, shapes)
        rule = any_number
    else:
        rule, value = of_scene(scene, key, place)
        unit = unit_of(key) or "-"
    places = places_of(key, place, value, is_symmetric(rule))
    return [
        Parameter(
            name=key + (f"[{','.join(str(i + 1) for i in at)}]" if at else ""),
            key=key, place=at, start=float(value[at]), low=rule.low, high=rule.high, unit=unit,
        )
        for at in places
    ]  # fmt: skip


def of_instrument(
    key: str, shapes: Mapping[str, tuple[int, ...]]
) -> tuple[Float[np.ndarray, "*entry"], str]:
    """Zeros for the numbers of an instrument, and their unit."""
    kind, _, observable = key.partition(".")
    if observable not in shapes:
        raise SceneError(FREE, f"name observables of the data ({', '.join(shapes)})", f"has {key}")
    if kind == BIAS:
        return np.zeros(shapes[observable]), described(observable).unit
    if described(observable).axes[-1:] != ("xyz",):
        raise SceneError(FREE, "have misalignments of vectors only", f"has {key}")
    return np.zeros(3), "rad"


def of_scene(scene: Scene, key: str, place: str | None) -> tuple[Rule, Float[np.ndarray, "*entry"]]:
    """The rule of a key of the scene and its value, one number for each tether if these have a parameter
    each."""
    rule = rule_of_number(scene, key, "free")
    table, _, name = key.partition(".")
    if table in ("integrator", "output"):
        raise SceneError(key, "be a number of the model to be free", "says how it is run")
    content = getattr(scene, table)
    value = None if content is None else getattr(content, name)
    value = ABSENT.get(key) if value is None and content is not None else value
    if value is None:
        raise SceneError(key, "have a value in the scene to be free", "has none")
    numbers = numbers_of(key, value)
    assert numbers is not None
    if place is not None and rule.shape in (Shape.MEMBER, Shape.HISTORY) and not numbers.ndim:
        numbers = np.full(scene.members.count, numbers)
    return rule, numbers


def places_of(
    key: str, place: str | None, value: Float[np.ndarray, "*entry"], symmetric: bool
) -> list[tuple[int, ...]]:
    """The places of a value that `KEY`, `KEY[*]` or `KEY[i,j]` means. Those of a symmetric matrix are those
    on its diagonal and above."""
    every = [tuple(at) for at in np.ndindex(value.shape)]
    if symmetric:
        every = [at for at in every if at[0] <= at[1]]
    if place is None:
        if value.ndim:
            must = f"say which numbers of {key}: {key}[*] or {key}[1]"
            raise SceneError(FREE, must, f"has {key}")
        return every
    if not value.ndim:
        raise SceneError(FREE, f"be {key} without brackets, as it is one number", f"has {key}[{place}]")
    if place == "*":
        return every
    at = tuple(int(i) - 1 for i in place.split(","))
    at = tuple(sorted(at)) if symmetric else at
    if at not in every:
        sizes = " x ".join(map(str, value.shape))
        raise SceneError(FREE, f"name one of the {sizes} places of {key}", f"has {key}[{place}]")
    return [at]


def is_symmetric(rule: Rule) -> bool:
    """Whether the values of a rule are tensors, the entries of which are equal in pairs. The roots of three
    tethers are none."""
    return rule.shape is Shape.MATRIX


def check_starts(parameters: Sequence[Parameter]) -> None:
    """Raises SceneError for a parameter that starts outside of its bounds."""
    for parameter in parameters:
        if not parameter.low <= parameter.start <= parameter.high:
            must = f"lie in [{parameter.low:g}, {parameter.high:g}]"
            raise SceneError(parameter.name, must, f"is {parameter.start:g}")


# ---- from the parameters to a run -----------------------------------------------------------------


def overrides_of(
    scene: Scene, parameters: Sequence[Parameter]
) -> Callable[[Float[Array, " parameter"]], dict[str, Any]]:
    """The function from the values of the parameters to overrides of the scene."""
    keys = dict.fromkeys(p.key for p in parameters if not p.of_instrument)
    bases, symmetric = {}, {}
    for key in keys:
        place = "*" if any(p.place for p in parameters if p.key == key) else None
        rule, bases[key] = of_scene(scene, key, place)
        symmetric[key] = is_symmetric(rule)

    def overrides(values: Float[Array, " parameter"]) -> dict[str, Any]:
        found: dict[str, Any] = {key: jnp.asarray(base) for key, base in bases.items()}
        for i, parameter in enumerate(parameters):
            if parameter.of_instrument:
                continue
            key, at = parameter.key, parameter.place
            for entry in {at, at[::-1]} if symmetric[key] else {at}:
                found[key] = found[key].at[entry].set(values[i])
        return found

    return overrides


def shown_by(
    parameters: Sequence[Parameter],
    values: Float[Array, " parameter"],
    name: str,
    true: Float[Array, "time *some"],
) -> Float[Array, "time *some"]:
    """What an instrument shows of an observable: turned by its misalignment, and with its bias,

    R(theta) h + b,   R(theta) the rotation by the angle |theta| about theta in the axes of the observable.
    """
    angles, bias = jnp.zeros(3), jnp.zeros(true.shape[1:])
    turned = False
    for i, parameter in enumerate(parameters):
        if parameter.key == f"{MISALIGNMENT}.{name}":
            angles, turned = angles.at[parameter.place].set(values[i]), True
        elif parameter.key == f"{BIAS}.{name}":
            bias = bias.at[parameter.place].set(values[i])
    return (true @ rotation_by(angles).T if turned else true) + bias
