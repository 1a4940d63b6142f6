"""A scene: what is there, and its numbers. One frozen dataclass per table of the TOML file.

A table that is `None` is an absent part of the model. Physical numbers may be JAX arrays, traced or
not; everything that decides *which* program is compiled takes plain Python values. Fields say `Any`
because a table may hold anything until a `Scene` is made of it: that is where values are checked.
"""

import dataclasses
import difflib
import os
import tomllib
from collections.abc import Mapping
from typing import Any

import numpy as np

from esail_jax.scenes import keys
from esail_jax.scenes.keys import SceneError, declare


@dataclasses.dataclass(frozen=True)
class Hub:
    """Rigid cylinder about X_B ([PGV] Table 1)."""

    height: Any = declare(keys.positive())  # m
    radius: Any = declare(keys.positive())  # m
    density: Any = declare(keys.positive())  # kg/m^3


@dataclasses.dataclass(frozen=True)
class Tethers:
    """Main tethers, one number for all or a list with one per tether."""

    count: Any = declare(keys.count())
    length: Any = declare(keys.positive("tether"))  # m, undeformed
    area: Any = declare(keys.positive("tether"))  # m^2
    density: Any = declare(keys.positive("tether"))  # kg/m^3
    youngs_modulus: Any = declare(keys.positive("tether"))  # Pa
    second_moment: Any = declare(keys.positive("tether"), None)  # m^4, needed for bending
    element: Any = declare(keys.choice("cable", "truss"), "cable")
    elements: Any = declare(keys.count(), 5)
    strain: Any = declare(keys.choice("green-lagrange", "engineering"), "green-lagrange")
    bending: Any = declare(keys.switch(), False)
    axial_damping_time: Any = declare(keys.non_negative("tether"), None)  # s
    bending_damping_time: Any = declare(keys.non_negative("tether"), None)  # s, with bending
    root: Any = declare(keys.choice("pinned", "clamped"), "pinned")


@dataclasses.dataclass(frozen=True)
class RemoteUnits:
    """Point masses at the tips."""

    mass: Any = declare(keys.non_negative("tether"))  # kg


@dataclasses.dataclass(frozen=True)
class SolarWind:
    """Local values at the sail ([PGV] after Eq. 28)."""

    speed: Any = declare(keys.positive())  # m/s
    number_density: Any = declare(keys.non_negative())  # 1/m^3
    cutoff_voltage: Any = declare(keys.any_number())  # V, V_1


@dataclasses.dataclass(frozen=True)
class Voltage:
    """Tether voltage V_0."""

    value: Any = declare(keys.any_number("tether"))  # V


@dataclasses.dataclass(frozen=True)
class Gravity:
    """Uniform gravity in the inertial frame."""

    acceleration: Any = declare(keys.any_number("vector"))  # m/s^2


@dataclasses.dataclass(frozen=True)
class Initial:
    """State at t = 0 ([PGV] Sec. 4.1)."""

    spin_rate: Any = declare(keys.any_number())  # rad/s about X_B
    sailing_angle_deg: Any = declare(
        keys.between("lie in (-180, 180]", lambda x: bool(((x > -180.0) & (x <= 180.0)).all())),
        0.0,
    )
    heliocentric_position_au: Any = declare(
        keys.any_number("vector"), (0.7071067811865476, 0.7071067811865476, 0.0)
    )
    elongation: Any = declare(keys.choice("steady", "paper"), "steady")
    coning_angle_deg: Any = declare(
        keys.between("lie in (-90, 90)", lambda x: bool((np.abs(x) < 90.0).all())), 0.0
    )


@dataclasses.dataclass(frozen=True)
class Integrator:
    """Time integration."""

    t_end: Any = declare(keys.positive(structure=True))  # s
    method: Any = declare(keys.choice("generalized-alpha"), "generalized-alpha")
    step: Any = declare(keys.positive(structure=True), 0.1)  # s
    spectral_radius: Any = declare(
        keys.between("lie in [0, 1]", lambda x: bool(((x >= 0.0) & (x <= 1.0)).all())), 0.25
    )


@dataclasses.dataclass(frozen=True)
class Output:
    """What is kept."""

    interval: Any = declare(keys.positive(structure=True))  # s


@dataclasses.dataclass(frozen=True)
class Scene:
    """Everything a run needs; checked on construction.

    Raises SceneError with one line that names the key.
    """

    tethers: Tethers
    initial: Initial
    integrator: Integrator
    hub: Hub | None = None
    remote_units: RemoteUnits | None = None
    solar_wind: SolarWind | None = None
    voltage: Voltage | None = None
    gravity: Gravity | None = None
    output: Output | None = None

    def __post_init__(self):
        object.__setattr__(self, "tethers", checked("tethers", self.tethers, None))
        for table in TABLES:
            content = getattr(self, table)
            if content is not None:
                object.__setattr__(self, table, checked(table, content, self.tethers.count))
        if self.output is None:
            interval = self.integrator.t_end / 1000.0
            object.__setattr__(self, "output", Output(interval=interval))
        check_together(self)

    def replace(self, overrides: Mapping[str, Any]) -> "Scene":
        """The scene with other values, by key; a table that was absent comes into being."""
        tables = {name: given(content) for name, content in vars(self).items() if content is not None}
        return from_tables(merged(tables, overrides))


TABLES = {
    "hub": Hub,
    "tethers": Tethers,
    "remote_units": RemoteUnits,
    "solar_wind": SolarWind,
    "voltage": Voltage,
    "gravity": Gravity,
    "initial": Initial,
    "integrator": Integrator,
    "output": Output,
}


def names_of(table: str) -> list[str]:
    return [field.name for field in dataclasses.fields(TABLES[table])]


def given(content: Any) -> dict[str, Any]:
    """The keys of a table that have a value."""
    return {name: value for name, value in vars(content).items() if value is not None}


def unknown(key: str) -> SceneError:
    """Error for a key nobody knows, with the nearest one that exists."""
    known = [f"{table}.{name}" for table in TABLES for name in names_of(table)]
    if key in TABLES:
        return SceneError(key, "be followed by a key of the table", "is the table's name")
    near = difflib.get_close_matches(key, known + list(TABLES), 1)
    hint = f" (perhaps `{near[0]}`)" if near else ""
    return SceneError(key, "be a known key" + hint, "is not")


def checked(table: str, content: Any, tethers: int | None) -> Any:
    """The table with every value checked."""
    values = {}
    for field in dataclasses.fields(content):
        value = getattr(content, field.name)
        if value is not None:
            value = keys.check_value(f"{table}.{field.name}", value, keys.rule_of(field), tethers)
        elif field.default is dataclasses.MISSING:
            raise SceneError(f"{table}.{field.name}", "be given", "is missing")
        values[field.name] = value
    return type(content)(**values)


def check_together(scene: Scene) -> None:
    """What no single key can show."""
    tethers, clamped = scene.tethers, scene.tethers.root == "clamped"
    if tethers.element == "truss" and tethers.bending:
        raise SceneError("tethers.bending", "be false for truss elements", "is true")
    if tethers.element == "truss" and clamped:
        raise SceneError("tethers.root", 'be "pinned" for truss elements', 'is "clamped"')
    if tethers.bending and tethers.second_moment is None:
        raise SceneError("tethers.second_moment", "be given with `tethers.bending`", "is missing")
    if (scene.voltage is None) != (scene.solar_wind is None):
        have, lack = ("solar_wind", "voltage") if scene.voltage is None else ("voltage", "solar_wind")
        first = names_of(lack)[0]
        raise SceneError(f"{lack}.{first}", f"be given with [{have}]", "is missing")
    radius = scene.integrator.spectral_radius
    limited = scene.hub is not None or clamped
    if limited and keys.known(radius) is not None and keys.known(radius) >= 1.0:
        raise SceneError("integrator.spectral_radius", "be below 1 with constraints", keys.describe(radius))
    position = keys.known(scene.initial.heliocentric_position_au)
    if position is not None and position[0] == position[1] == 0.0:
        raise SceneError(
            "initial.heliocentric_position_au",
            "not lie on the ecliptic's axis",
            keys.describe(position),
        )


def from_tables(tables: Mapping[str, Any]) -> Scene:
    """A scene from nested mappings, as a TOML file gives them. Raises SceneError."""
    parts = {}
    for table, content in tables.items():
        if table not in TABLES:
            raise unknown(table)
        if not isinstance(content, Mapping):
            raise SceneError(table, "be a table", keys.describe(content))
        for name in content:
            if name not in names_of(table):
                raise unknown(f"{table}.{name}")
        for field in dataclasses.fields(TABLES[table]):
            if field.default is dataclasses.MISSING and field.name not in content:
                raise SceneError(f"{table}.{field.name}", "be given", "is missing")
        parts[table] = TABLES[table](**content)
    for table, content in Scene.__dataclass_fields__.items():
        if content.default is dataclasses.MISSING and table not in parts:
            raise SceneError(f"{table}.{names_of(table)[0]}", "be given", "is missing")
    return Scene(**parts)


def merged(tables: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Tables with other values, by key. An interval that nobody gives stays that of the tables' own
    t_end, so that a run may go on to a later one. Raises SceneError."""
    result = {name: dict(x) if isinstance(x, Mapping) else x for name, x in tables.items()}
    for key, value in overrides.items():
        table, _, name = key.partition(".")
        if table not in TABLES or name not in names_of(table):
            raise unknown(key)
        content = result.setdefault(table, {})
        if not isinstance(content, dict):
            raise SceneError(table, "be a table", keys.describe(content))
        content[name] = value
    schedule = tables.get("integrator")
    if "output" not in result and isinstance(schedule, Mapping) and "t_end" in schedule:
        rule = keys.rule_of(Integrator.__dataclass_fields__["t_end"])
        t_end = keys.check_value("integrator.t_end", schedule["t_end"], rule, None)
        result["output"] = {"interval": t_end / 1000.0}
    return result


def parse(text: str, source: str, overrides: Mapping[str, Any] | None = None) -> Scene:
    """A scene from TOML text; `source` names it in errors. `overrides` come before any check, so
    that they may give what the text lacks."""
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # also numbers of thousands of digits
        raise SceneError(source, "be a TOML file", f"is not: {error}") from None
    return from_tables(merged(tables, overrides or {}))


def to_toml(scene: Scene) -> str:
    """TOML text from which `parse` makes the same scene again, digit for digit."""
    lines = []
    for table in TABLES:
        content = getattr(scene, table)
        if content is not None:
            lines += [
                f"[{table}]",
                *(f"{k} = {toml_value(v)}" for k, v in given(content).items()),
                "",
            ]
    return "\n".join(lines)


def toml_value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, int):
        return str(value)
    array = np.asarray(value, float)
    if array.ndim == 0:
        return repr(float(array))
    return "[" + ", ".join(toml_value(float(x)) for x in array) + "]"


def load_scene(source: "str | os.PathLike | Scene", overrides: Mapping[str, Any] | None = None) -> Scene:
    """A built-in scene by name, a TOML file by path, or a Scene as it is; `overrides` by scene key
    may also give what the file lacks. Raises SceneError."""
    from esail_jax.scenes.presets import builtin_text

    if isinstance(source, Scene):
        return source.replace(overrides or {})
    text = builtin_text(str(source))
    if text is None:
        try:
            with open(source, encoding="utf-8") as file:
                text = file.read()
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "is not text"
            raise SceneError(
                str(source), "be a built-in scene or a TOML file", f"cannot be read: {reason}"
            ) from None
    return parse(text, str(source), overrides)
