"""Descriptions of all keys of a scene, the source of its documentation; what a user may have meant by a
keyword that a function does not have; and the keys in which several scenes differ."""

import dataclasses
import functools
from collections.abc import Iterable, Sequence
from typing import Any

from esail_jax.scenes.declarations import rule_of
from esail_jax.scenes.overrides import (
    FRAME,
    FRAMES,
    KERNEL,
    OEM,
    POSITION_KM,
    START_AT,
    VELOCITY_KM_S,
    unknown,
)
from esail_jax.scenes.parts import CHAIN, PARTS, SAIL, given, names_of, table_names, tables_of
from esail_jax.scenes.rules import Kind, Rule, SceneError, Shape, describe
from esail_jax.scenes.scene import Scene
from esail_jax.wind_files.csv_rows import MUST
from esail_jax.wind_files.rows import LARGEST_GAP, WIND_FILE

MEMBERS = {SAIL: "tether", CHAIN: "rod"}
"""What a member of each model is called."""


@dataclasses.dataclass(frozen=True)
class KeyDescription:
    """Description of one key of a scene.

    models: "sail", "chain" or both; type: what a TOML file may give, in words; unit: "-" if it has none;
    default: None if the key may be absent; required: whether it must be given wherever its table is; rule:
    the condition that its value must satisfy; traceable: whether it may be a JAX array, traced or not; doc:
    one sentence."""

    table: str
    name: str
    models: tuple[str, ...]
    type: str
    unit: str
    default: Any
    required: bool
    rule: str
    traceable: bool
    doc: str

    @property
    def key(self) -> str:
        """The key as overrides name it: `tethers.length`."""
        return f"{self.table}.{self.name}"


def describe_keys() -> tuple[KeyDescription, ...]:
    """Describes all keys, in the order of the tables and their keys. A key whose table differs between the
    models has one description per model."""
    keys = []
    for table in table_names():
        for part in (part for part in PARTS if part.name == table):
            keys += [describe_key(table, field, part.models) for field in dataclasses.fields(part.table)]
        if table == "solar_wind":
            keys += wind_file_keys()
        if table == "orbit":
            keys += orbit_start_keys()
    return tuple(keys)


@functools.cache
def unit_of(key: str) -> str | None:
    """The unit of a key, "-" if it has none; None for what is no key of a scene, such as a number of a law
    of a user."""
    return next((described.unit for described in describe_keys() if described.key == key), None)


def rule_of_number(scene: Scene, key: str, use: str) -> Rule:
    """The rule of a key with physical numbers. use: what they shall be, in words, such as "varied". Raises
    SceneError for any other key."""
    kinds = tables_of(scene.model)
    table, _, name = key.partition(".")
    if table not in kinds or name not in names_of(kinds[table]):
        raise unknown(key, scene.model)
    (field,) = (field for field in dataclasses.fields(kinds[table]) if field.name == name)
    rule = rule_of(field)
    if rule.structure or rule.kind is not Kind.NUMBER:
        raise SceneError(key, f"be a physical number to be {use}", "is structure")
    return rule


def describe_key(table: str, field: dataclasses.Field, models: tuple[str, ...]) -> KeyDescription:
    """Describes one field of a table."""
    rule, required = rule_of(field), field.default is dataclasses.MISSING
    return KeyDescription(
        table=table,
        name=field.name,
        models=models,
        type=type_in_words(rule, MEMBERS[models[0]]),
        unit=field.metadata["unit"],
        default=None if required else field.default,
        required=required,
        rule=f"must {rule.must}",
        traceable=not rule.structure,
        doc=field.metadata["doc"],
    )


def type_in_words(rule: Rule, member: str) -> str:
    """What a TOML file may give for a key. member: `tether` or `rod`."""
    if rule.kind is Kind.CHOICE:
        return "one of " + ", ".join(f'"{name}"' for name in rule.choices)
    if rule.kind is Kind.SWITCH:
        return "true or false"
    if rule.kind is Kind.DATE:
        return "date"
    if rule.kind is Kind.INTEGER:
        return "list of integers" if rule.shape is Shape.LIST else "integer"
    return rule.shape.value.replace("member", member)


def wind_file_keys() -> tuple[KeyDescription, KeyDescription]:
    """Describes `solar_wind.file` and `solar_wind.largest_gap`, which no table has: the numbers of the
    files take their place."""
    file = KeyDescription(
        table="solar_wind",
        name=WIND_FILE.partition(".")[2],
        models=("sail",),
        type="name of a file, or list of names",
        unit="-",
        default=None,
        required=False,
        rule=f"must {MUST}",
        traceable=False,
        doc="Files that give `time`, `speed` and `number_density` in place of these keys; dates in them "
        "need `initial.epoch`.",
    )
    gap = dataclasses.replace(
        file,
        name=LARGEST_GAP.partition(".")[2],
        type="number",
        unit="s",
        rule="must be positive",
        doc="Longest gap of `file`, between the rows before and behind, that a straight line bridges; "
        "every gap is refused if left out.",
    )
    return file, gap


def orbit_start_keys() -> tuple[KeyDescription, ...]:
    """Describes the keys of [orbit] that stand for `position_au` and `velocity` of a sail."""
    planet = 'Planet at whose place the orbit starts, such as "earth"; needs `kernel` and `initial.epoch`.'
    message = "Orbit Ephemeris Message of the CCSDS on which the orbit starts; needs `initial.epoch`."
    axes = "Axes of the position and the velocity: ecliptic or equator of J2000."
    rows = (
        (START_AT, "name of a planet", "-", planet),
        (KERNEL, "name of a file", "-", "Kernel of planets (SPK), such as de421.bsp; needs jplephem."),
        (OEM, "name of a file", "-", message),
        (POSITION_KM, "list of three numbers", "km", "Heliocentric position of the hub at t = 0."),
        (VELOCITY_KM_S, "list of three numbers", "km/s", "Heliocentric velocity of the hub at t = 0."),
        (FRAME, 'one of "ecliptic", "equatorial"', "-", axes),
    )
    return tuple(
        KeyDescription(
            table="orbit",
            name=key.partition(".")[2],
            models=("sail",),
            type=kind,
            unit=unit,
            default=FRAMES[0] if key == FRAME else None,
            required=False,
            rule="must not be zero" if key in (POSITION_KM, VELOCITY_KM_S) else f"must be a {kind}",
            traceable=key in (POSITION_KM, VELOCITY_KM_S),
            doc=doc,
        )
        for key, kind, unit, doc in rows
    )


def refuse_keywords(function: str, unknown: Iterable[str]) -> None:
    """Raises TypeError for the first keyword that is no argument of a function of a scene. Values of a
    scene's keys go by their whole names in `overrides`: the message shows those that end in the keyword."""
    for name in unknown:
        keys = dict.fromkeys(key.key for key in describe_keys() if key.name == name)
        shown = " or ".join(f'{{"{key}": ...}}' for key in keys) or '{"integrator.t_end": 100.0}'
        raise TypeError(
            f"`{function}` has no argument `{name}`: values of scene keys are given by key, as in "
            f"{function}(scene, {shown})"
        )


ABSENT = "-"
"""Text for a key that a scene does not have."""


LONGEST = 60
"""Largest number of characters of a value."""


LARGE = 1e7
"""Whole numbers from here on are written with an exponent."""


def differing_keys(scenes: Sequence[Scene]) -> dict[str, tuple[str, ...]]:
    """The keys whose values are not the same in all scenes, each with its value in every scene as a
    short text. Keys have the order of the scenes' tables."""
    values = [values_by_key(scene) for scene in scenes]
    keys = dict.fromkeys(key for one in values for key in one)
    differ = (key for key in keys if any(one.get(key) != values[0].get(key) for one in values))
    return {key: tuple(text_of(one.get(key)) for one in values) for key in differ}


def values_by_key(scene: Scene) -> dict[str, Any]:
    """The values that a scene has, by `table.key`."""
    tables = scene.tables.items()
    return {f"{table}.{name}": x for table, content in tables for name, x in given(content).items()}


def text_of(value: Any) -> str:
    """A value as a text of at most about sixty characters: numbers as people write them, lists
    without brackets."""
    if value is None:
        return ABSENT
    value = value.tolist() if hasattr(value, "tolist") else value
    items = value if isinstance(value, (list, tuple)) else [value]
    if not items or not all(isinstance(item, (str, bool, int, float)) for item in items):
        return describe(value).removeprefix("is ")
    text = ", ".join(in_plain_words(item) for item in items)
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def in_plain_words(item: str | bool | int | float) -> str:
    """An entry of a list, or a single value, as a text: 1000 in place of 1000.0."""
    if isinstance(item, float) and item.is_integer() and abs(item) < LARGE:
        return str(int(item))
    return describe(item).removeprefix("is ").strip("'")
