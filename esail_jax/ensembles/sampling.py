"""Inputs of an ensemble: numbers of a scene drawn member by member.

A member's numbers do not depend on how many members there are, so that an ensemble may grow: independent
ones follow from the seed, the key and the member's number, those of a Sobol sequence from the seed, that
number and all that is drawn. Only a Latin hypercube is laid out for all its members together.
"""

import dataclasses
import math
import warnings
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

from esail_jax.array_types import Float
from esail_jax.scenes.rules import Rule, SceneError, rule_of
from esail_jax.scenes.scene import Scene, unknown
from esail_jax.scenes.tables import names_of, tables_of
from esail_jax.scenes.value_types import Kind, Shape

Inputs = dict[str, Float[np.ndarray, "member ..."]]

SAMPLINGS = ("random", "sobol", "latin")
"""Independent draws; a scrambled Sobol sequence; a Latin hypercube."""

FORMS = {"uniform": ("a", "b"), "normal": ("mean", "sd"), "grid": ("a", "b", "n")}
"""Distributions, and their numbers."""

HALF_STEP = 2.0**-54
"""Half the distance of the numbers that are drawn in [0, 1): keeps them off the ends."""


class VariationError(ValueError):
    """A variation that cannot be understood."""


@dataclasses.dataclass(frozen=True)
class Variation:
    """What is varied and how. key: of the scene; form: of `FORMS`; numbers: of the form; each: a number
    per tether (or rod), not one for all."""

    key: str
    form: str
    numbers: tuple[float, ...]
    each: bool = False

    @property
    def text(self) -> str:
        """As the command line has it, without the key."""
        return ":".join([self.form, *(repr(x) for x in self.numbers)])


def parse_variation(text: str) -> Variation:
    """KEY=DIST or KEY[*]=DIST. Raises VariationError."""
    key, equals, distribution = text.partition("=")
    form, *numbers = distribution.strip().split(":")
    key = key.strip()
    if not equals or "." not in key or form not in FORMS:
        forms = ", ".join(f"KEY={':'.join([name, *names])}" for name, names in FORMS.items())
        raise VariationError(f"`--vary` must look like one of {forms}, but is {text!r}")
    try:
        values = tuple(float(x) for x in numbers)
    except ValueError:
        values = ()
    if len(values) != len(FORMS[form]) or not all(math.isfinite(x) for x in values):
        wanted = ":".join([form, *FORMS[form]])
        raise VariationError(f"`--vary {key}` must be {wanted} with finite numbers, but is {distribution}")
    if form == "uniform" and values[1] < values[0]:
        raise VariationError(f"`--vary {key}` must have a <= b, but is {distribution}")
    if form == "normal" and values[1] < 0.0:
        raise VariationError(f"`--vary {key}` must have sd >= 0, but is {distribution}")
    if form == "grid" and (values[2] < 1.0 or values[2] != int(values[2])):
        raise VariationError(f"`--vary {key}` must have a positive integer n, but is {distribution}")
    each = key.endswith("[*]")
    return Variation(key.removesuffix("[*]"), form, values, each)


def draw(
    scene: Scene, variations: Sequence[Variation], members: int, seed: int = 0, sampling: str = "random"
) -> Inputs:
    """Values by key, (member) or (member, tether).

    Grids are run through together, the last one fastest, and again from the start when they end. Raises
    SceneError for keys that cannot be varied, and for the first member with a number out of bounds;
    VariationError for a key that is given twice."""
    counts = [columns_of(scene, variation) for variation in variations]
    keys = [variation.key for variation in variations]
    for key in keys:
        if keys.count(key) > 1:
            raise VariationError(f"`--vary {key}` must be given once, but is given {keys.count(key)} times")
    points = unit_points(variations, counts, members, seed, sampling)
    inputs, stride = {}, 1
    for variation, count, u in reversed(list(zip(variations, counts, points, strict=True))):
        if variation.form == "grid":
            a, b, n = variation.numbers
            strides = stride * int(n) ** np.arange(count)[::-1]
            stride *= int(n) ** count
            place = (np.arange(members)[:, None] // strides) % int(n)
            values = np.linspace(a, b, int(n))[place]
        elif variation.form == "uniform":
            a, b = variation.numbers
            values = a + (b - a) * u
        else:
            mean, sd = variation.numbers
            values = mean + sd * ndtri(u)
        inputs[variation.key] = values if variation.each else values[:, 0]
    inputs = {key: inputs[key] for key in keys}
    check(scene, inputs)
    return inputs


def columns_of(scene: Scene, variation: Variation) -> int:
    """How many numbers of a member a variation draws. Raises SceneError."""
    rule = varied_rule(scene, variation.key)
    if not variation.each:
        return 1
    if rule.shape is not Shape.MEMBER:
        name = scene.members.name
        raise SceneError(f"{variation.key}[*]", f"be a key with a number per {name}", "is none")
    return scene.members.count


def varied_rule(scene: Scene, key: str) -> Rule:
    """The rule of a key that may be varied. Raises SceneError."""
    kinds = tables_of([scene.main])
    table, _, name = key.partition(".")
    if table not in kinds or name not in names_of(kinds[table]):
        raise unknown(key, kinds)
    rule = rule_of(kinds[table].__dataclass_fields__[name])
    if rule.structure or rule.kind is not Kind.NUMBER:
        raise SceneError(key, "be a physical number to be varied", "is structure")
    return rule


def unit_points(
    variations: Sequence[Variation], counts: Sequence[int], members: int, seed: int, sampling: str
) -> list[Float[np.ndarray, "member column"]]:
    """Numbers in (0, 1), for every variation as many columns as it draws (grids draw none)."""
    drawn = [0 if v.form == "grid" else n for v, n in zip(variations, counts, strict=True)]
    if sampling == "random":
        parts = [independent(v.key, seed, members, n) for v, n in zip(variations, drawn, strict=True)]
    else:
        u = laid_out(sampling, sum(drawn), members, seed)
        parts = np.split(u, np.cumsum(drawn)[:-1], axis=1) if drawn else []
    return [np.clip(u, HALF_STEP, 1.0 - HALF_STEP) for u in parts]


def independent(key: str, seed: int, members: int, columns: int) -> Float[np.ndarray, "member column"]:
    """Of every member a stream of its own: a counter-based generator keyed by seed and key."""
    if not columns:
        return np.empty((members, 0))
    keys = np.array([seed, zlib.crc32(key.encode())], np.uint64)
    streams = (np.random.Philox(key=keys, counter=[0, 0, 0, member]) for member in range(members))
    return np.stack([np.random.Generator(stream).random(columns) for stream in streams])


def laid_out(sampling: str, columns: int, members: int, seed: int) -> Float[np.ndarray, "member column"]:
    """Points that fill the cube evenly, of a scrambled Sobol sequence or a Latin hypercube."""
    if not columns:
        return np.empty((members, 0))
    kind = {"sobol": qmc.Sobol, "latin": qmc.LatinHypercube}[sampling]
    with warnings.catch_warnings():
        # The first points of the sequence are asked for whether or not they are a power of two.
        warnings.filterwarnings("ignore", message="The balance properties", category=UserWarning)
        return kind(columns, rng=np.random.default_rng(seed)).random(members)


def check(scene: Scene, inputs: Inputs) -> None:
    """Raise SceneError for the first member whose numbers make no scene."""
    for member in range(len(next(iter(inputs.values()), ()))):
        try:
            scene.replace(of_members(inputs, member))
        except SceneError as error:
            raise SceneError(error.key, error.must, f"{error.got} (member {member})") from None


def of_members(inputs: Inputs, members: int | np.integer | np.ndarray) -> dict[str, Any]:
    """The inputs of a member, or of several."""
    return {key: values[members] for key, values in inputs.items()}
