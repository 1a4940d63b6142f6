"""Inputs of an ensemble: numbers of a scene, drawn for every member.

The numbers of a member do not depend on how many members there are, so an ensemble may grow. Independent
draws follow from the seed, the key and the member's number. Points of a Sobol sequence follow from the
seed, the member's number and the set of all keys that are drawn. Only a Latin hypercube depends on the
number of members.
"""

import dataclasses
import functools
import os
import warnings
import zlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import qmc

from esail_jax.array_types import Float, Int
from esail_jax.ensembles.distributions import (
    FORMS,
    Distribution,
    Grid,
    as_distribution,
    form_of,
    parse_distribution,
)
from esail_jax.scenes.key_reference import rule_of_number
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.rules import SceneError, Shape, describe, numbers_of
from esail_jax.scenes.scene import Scene

Inputs = dict[str, Float[np.ndarray, "member ..."]]
"""Values by scene key, member first."""

SAMPLINGS = ("random", "sobol", "latin")
"""Independent draws; a scrambled Sobol sequence; a Latin hypercube."""

HALF_STEP = 2.0**-54
"""Half the distance between neighbouring draws in [0, 1). Draws are kept this far from 0 and 1, where the
inverse of the normal distribution is infinite."""

PER_TETHER = "[*]"
"""Suffix of a key that gets one number per tether."""


class VariationError(SceneError):
    """An entry of `vary` that cannot be understood."""


@dataclasses.dataclass(frozen=True)
class Variation:
    """A scene key and the distribution of its values."""

    key: str
    distribution: Distribution

    @property
    def text(self) -> str:
        """The variation as on the command line, such as `hub.radius=uniform:1.0:2.0`."""
        suffix = PER_TETHER if self.distribution.per_tether else ""
        return f"{self.key}{suffix}={self.distribution.text}"


Vary = Mapping[str, Distribution | str] | Sequence[Variation | str]
"""What to vary: distributions (or their texts) by scene key, or `KEY=DIST` texts in a list. A key that ends
in `[*]` gets one number per tether."""


def parse_variation(text: str) -> Variation:
    """Reads KEY=DIST or KEY[*]=DIST. Raises VariationError."""
    key, equals, distribution_text = text.partition("=")
    key = key.strip()
    if not equals or "." not in key or distribution_text.strip().partition(":")[0] not in FORMS:
        forms = ", ".join(f"KEY={form_of(kind)}" for kind in FORMS.values())
        raise VariationError("vary", f"look like one of {forms}", f"is {text!r}")
    try:
        distribution = parse_distribution(distribution_text, key.endswith(PER_TETHER))
    except SceneError as error:
        raise VariationError(f"vary {key}", error.must, error.got) from None
    return Variation(key.removesuffix(PER_TETHER), distribution)


def variations_of(vary: Vary) -> list[Variation]:
    """The variations that a mapping or a list describes. Raises SceneError, VariationError."""
    if isinstance(vary, str) or not isinstance(vary, Mapping | Sequence):
        must = "be distributions by scene key, or a list of KEY=DIST"
        raise VariationError("vary", must, f"is {vary!r}")
    if not isinstance(vary, Mapping):
        return [parse_variation(item) if isinstance(item, str) else item for item in vary]
    variations = []
    for key, value in vary.items():
        if not isinstance(key, str):
            raise VariationError("vary", "have keys of a scene", f"has {key!r}")
        try:
            distribution = as_distribution(value, key.endswith(PER_TETHER))
        except SceneError as error:
            raise SceneError(key, error.must, error.got) from None
        variations.append(Variation(key.removesuffix(PER_TETHER), distribution))
    return variations


def draw(
    scene: Scene | str | os.PathLike,
    vary: Vary,
    members: int,
    seed: int = 0,
    sampling: str = "random",
) -> Inputs:
    """Draws the inputs of an ensemble: arrays by scene key, of shape (member) or (member, tether).

    scene: a scene, the name of a built-in one, or the path of a file; vary: for example
    `{"tethers.length": Normal(10e3, 10, per_tether=True)}`; sampling: of `SAMPLINGS`.

    Raises SceneError for keys that cannot be varied and for the first member with a value out of bounds,
    VariationError for a key that is given twice."""
    draws = draws_of(scene, vary, members, seed, sampling)
    inputs = draws.of(np.arange(members))
    check(draws.scene, inputs)
    return inputs


BLOCK = 8192
"""Number of members whose points are drawn at once."""


class Draws:
    """The inputs of an ensemble, drawn when they are needed: those of a million members need not be in
    memory.

    columns: number of values that a member draws for each variation; count: number of members."""

    def __init__(
        self,
        scene: Scene,
        variations: Sequence[Variation],
        columns: Sequence[int],
        count: int,
        seed: int,
        sampling: str,
    ):
        self.scene, self.variations, self.count = scene, tuple(variations), count
        self.seed, self.sampling, self._columns = seed, sampling, tuple(columns)
        self._points = functools.lru_cache(maxsize=2)(self._draw)

    @property
    def columns(self) -> int:
        """Number of values of one member."""
        return sum(self._columns)

    def of(self, members: Int[np.ndarray, " member"]) -> Inputs:
        """The inputs of some members. Points of a block of members are drawn together."""
        size = self.count if self.sampling == "latin" else min(self.count, BLOCK)
        blocks = members // size
        parts = [self._points(int(b), size) for b in np.unique(blocks)]
        rows = np.searchsorted(np.unique(blocks), blocks) * size + members % size
        inputs: Inputs = {}
        stride: Any = 1
        for k in reversed(range(len(self.variations))):
            variation, count = self.variations[k], self._columns[k]
            distribution: Any = variation.distribution
            if isinstance(distribution, Grid):
                # The last grid varies fastest, and of one grid per tether the last tether.
                strides = stride * distribution.n ** np.arange(count)[::-1]
                stride *= distribution.n**count
                place = (members[:, None] // strides) % distribution.n
                values = distribution.points()[place]
            else:
                values = distribution.values(np.concatenate([part[k] for part in parts])[rows])
            inputs[variation.key] = values if distribution.per_tether else values[:, 0]
        return {variation.key: inputs[variation.key] for variation in self.variations}

    def _draw(self, block: int, size: int) -> list[Float[np.ndarray, "member column"]]:
        """Points of a block of members in the open unit cube. The last block may go beyond the last member
        (but not that of a Latin hypercube)."""
        return unit_points(self.variations, self._columns, block * size, size, self.seed, self.sampling)


def draws_of(
    scene: Scene | str | os.PathLike, vary: Vary, members: int, seed: int = 0, sampling: str = "random"
) -> Draws:
    """The inputs of an ensemble, which are not drawn yet. The arguments are those of `draw`.

    Raises SceneError for keys that cannot be varied, VariationError for a key that is given twice."""
    scene = load_scene(scene)
    variations = variations_of(vary)
    check_numbers(members, seed, sampling)
    columns = [columns_of(scene, variation) for variation in variations]
    keys = [variation.key for variation in variations]
    for key in keys:
        if keys.count(key) > 1:
            raise VariationError(f"vary {key}", "be given once", f"is given {keys.count(key)} times")
    return Draws(scene, variations, columns, int(members), int(seed), sampling)


def check_numbers(members: int, seed: int, sampling: str) -> None:
    """Raises SceneError for numbers of members and seeds, and for samplings, that do not exist."""
    for name, value, least in (("members", members, 1), ("seed", seed, 0)):
        if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
            must = "be a positive integer" if least else "be an integer that is not negative"
            raise SceneError(name, must, f"is {value!r}")
    if seed >= 2**64:
        raise SceneError("seed", "be less than 2**64", f"is {seed}")
    if sampling not in SAMPLINGS:
        raise SceneError("sampling", f"be one of {', '.join(SAMPLINGS)}", f"is {sampling!r}")


def columns_of(scene: Scene, variation: Variation) -> int:
    """Number of values that one member draws for a variation. Raises SceneError."""
    rule = rule_of_number(scene, variation.key, "varied")
    if rule.shape in (Shape.VECTOR, Shape.VECTORS, Shape.MATRIX):
        must = "be a key of single numbers to be drawn"
        got = "is one of vectors (`simulate_members` takes an array of them)"
        raise SceneError(variation.key, must, got)
    if not variation.distribution.per_tether:
        return 1
    if rule.shape not in (Shape.MEMBER, Shape.HISTORY):
        name = scene.members.name
        raise SceneError(f"{variation.key}{PER_TETHER}", f"be a key with a number per {name}", "is none")
    return scene.members.count


def unit_points(
    variations: Sequence[Variation],
    counts: Sequence[int],
    first: int,
    members: int,
    seed: int,
    sampling: str,
) -> list[Float[np.ndarray, "member column"]]:
    """Points in the open unit cube, of `members` members from number `first` on: for every variation one
    column per number that a member draws (a grid draws none)."""
    drawn = [0 if isinstance(v.distribution, Grid) else n for v, n in zip(variations, counts, strict=True)]
    if sampling == "random":
        parts = [
            counter_based(v.key, seed, first, members, n) for v, n in zip(variations, drawn, strict=True)
        ]
    else:
        u = quasi_random(sampling, sum(drawn), first, members, seed)
        parts = np.split(u, np.cumsum(drawn)[:-1], axis=1) if drawn else []
    return [np.clip(u, HALF_STEP, 1.0 - HALF_STEP) for u in parts]


def counter_based(
    key: str, seed: int, first: int, members: int, columns: int
) -> Float[np.ndarray, "member column"]:
    """Independent draws in [0, 1). Every member has its own stream of a counter-based generator (Philox),
    which the seed and the scene key select."""
    if not columns:
        return np.empty((members, 0))
    keys = np.array([seed, zlib.crc32(key.encode())], np.uint64)
    streams = (np.random.Philox(key=keys, counter=[0, 0, 0, k]) for k in range(first, first + members))
    return np.stack([np.random.Generator(stream).random(columns) for stream in streams])


def quasi_random(
    sampling: str, columns: int, first: int, members: int, seed: int
) -> Float[np.ndarray, "member column"]:
    """Points that fill the unit cube evenly: a scrambled Sobol sequence or a Latin hypercube."""
    if not columns:
        return np.empty((members, 0))
    engine = {"sobol": qmc.Sobol, "latin": qmc.LatinHypercube}[sampling]
    with warnings.catch_warnings():
        # SciPy warns if the number of Sobol points is no power of two; any number is right here.
        warnings.filterwarnings("ignore", message="The balance properties", category=UserWarning)
        points = engine(columns, rng=np.random.default_rng(seed))
        return (points.fast_forward(first) if first else points).random(members)


def check(scene: Scene, inputs: Inputs, members: Int[np.ndarray, " member"] | None = None) -> None:
    """Raises SceneError for the first member whose values are refused by the scene. members: their numbers,
    None for 0, 1, ..."""
    for member in range(len(next(iter(inputs.values()), ()))):
        try:
            scene.replace(select_members(inputs, member))
        except SceneError as error:
            number = member if members is None else members[member]
            raise SceneError(error.key, error.must, f"{error.got} (member {number})") from None


def checked_inputs(scene: Scene, inputs: Mapping[str, Any]) -> Inputs:
    """Given inputs as arrays of float64, by position and not by label.

    Raises SceneError if a key cannot be varied, if the keys have different numbers of members, and for the
    first member with a value that the scene refuses."""
    if not inputs:
        raise SceneError("inputs", "have a value for every member", "is empty")
    arrays = {}
    for key, values in inputs.items():
        rule_of_number(scene, key, "varied")
        numbers = numbers_of(f"inputs[{key}]", values)
        if numbers is None or not numbers.ndim or not numbers.size:
            raise SceneError(f"inputs[{key}]", "have a value for every member", describe(values))
        arrays[key] = numbers
    first, *others = arrays
    for key in others:
        if len(arrays[key]) != len(arrays[first]):
            must = f"have {len(arrays[first])} members, as `inputs[{first}]` does"
            raise SceneError(f"inputs[{key}]", must, f"has {len(arrays[key])}")
    check(scene, arrays)
    return arrays


def select_members(inputs: Inputs, members: int | np.integer | np.ndarray) -> dict[str, Any]:
    """The inputs of one member, or of several."""
    return {key: values[members] for key, values in inputs.items()}
