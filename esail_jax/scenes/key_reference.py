"""Descriptions of all keys of a scene: the source of its documentation."""

import dataclasses
from typing import Any

from esail_jax.scenes import wind_file
from esail_jax.scenes.declarations import rule_of
from esail_jax.scenes.rules import Rule
from esail_jax.scenes.tables import CHAIN_TABLES, SAIL_TABLES, TABLES
from esail_jax.scenes.value_types import Kind, Shape

MODELS = {"sail": (SAIL_TABLES, "tether"), "chain": (CHAIN_TABLES, "rod")}
"""Tables of each model, and what one of its members is called."""


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
    found = []
    for table in TABLES:
        kinds = {model: tables[table] for model, (tables, _) in MODELS.items() if table in tables}
        for kind in dict.fromkeys(kinds.values()):
            models = tuple(model for model in kinds if kinds[model] is kind)
            found += [describe_key(table, field, models) for field in dataclasses.fields(kind)]
        if table == "solar_wind":
            found.append(wind_file_key())
    return tuple(found)


def describe_key(table: str, field: dataclasses.Field, models: tuple[str, ...]) -> KeyDescription:
    """Describes one field of a table."""
    rule, required = rule_of(field), field.default is dataclasses.MISSING
    return KeyDescription(
        table=table,
        name=field.name,
        models=models,
        type=type_in_words(rule, MODELS[models[0]][1]),
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
    if rule.kind is Kind.INTEGER:
        return "list of integers" if rule.shape is Shape.LIST else "integer"
    return rule.shape.value.replace("member", member)


def wind_file_key() -> KeyDescription:
    """Describes `solar_wind.file`, which no table has: its file's numbers take its place."""
    table, _, name = wind_file.KEY.partition(".")
    return KeyDescription(
        table=table,
        name=name,
        models=("sail",),
        type="name of a CSV file",
        unit="-",
        default=None,
        required=False,
        rule=f"must {wind_file.MUST}",
        traceable=False,
        doc="File that gives `time`, `speed` and `number_density` in place of these keys.",
    )
