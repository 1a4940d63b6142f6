"""A scene: the parts of a model and their numbers, from the tables of a TOML file or made in Python.

A table that is `None` is an absent part of the model. Physical numbers may be JAX arrays, traced or
not; values that decide which program is compiled must be plain Python values.
"""

import dataclasses
import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from esail_jax.errors import nearest
from esail_jax.html import html_table
from esail_jax.scenes import rules
from esail_jax.scenes.chain_tables import Chain, ChainInitial, ChainVoltage, ChainWind, Orbit, PlasmaBrake
from esail_jax.scenes.common_tables import Gravity, Integrator, Output
from esail_jax.scenes.consistency import check_together, method_name
from esail_jax.scenes.declarations import rule_of
from esail_jax.scenes.merging import merged, unknown
from esail_jax.scenes.orbit_table import HeliocentricOrbit
from esail_jax.scenes.own_law import KEY, with_own_law
from esail_jax.scenes.own_terms import KEY as OWN_TERMS
from esail_jax.scenes.own_terms import AbsentTerms, checked_terms
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.sail_tables import (
    ORIGIN_AU,
    Event,
    Hub,
    Initial,
    SolarWind,
    Tethers,
    Voltage,
)
from esail_jax.scenes.tables import TABLES, given, names_of, tables_of
from esail_jax.scenes.thermal_table import Thermal
from esail_jax.scenes.tip_tables import AuxiliaryTethers, RemoteUnits, TipThrust
from esail_jax.scenes.wind_file import with_wind_file


@dataclasses.dataclass(frozen=True, kw_only=True, repr=False)
class Scene:
    """Everything that a run of a sail (`tethers`) or of a chain of rods (`chain`) needs.

        esail.Scene(
            tethers=esail.Tethers(count=12, length=10e3, area=4.28e-9, density=7653.0, youngs_modulus=70e9),
            initial=esail.Initial(spin_rate=4e-3),
            integrator=esail.Integrator(t_end=4712.39),
        )

    Every value is checked on construction. Raises SceneError with one line that names the key.

    voltage_law: a voltage law that the user wrote, an `equinox.Module`
    (`loads/own_law.py` says what it must have), with `law = "python"` in [voltage]. terms: physics that the
    user wrote (`physics.py`). No file holds either.
    """

    initial: Initial | ChainInitial
    integrator: Integrator
    tethers: Tethers | None = None
    chain: Chain | None = None
    hub: Hub | None = None
    auxiliary_tethers: AuxiliaryTethers | None = None
    remote_units: RemoteUnits | None = None
    solar_wind: SolarWind | ChainWind | None = None
    voltage: Voltage | ChainVoltage | None = None
    tip_thrust: TipThrust | None = None
    thermal: Thermal | None = None
    gravity: Gravity | None = None
    orbit: Orbit | HeliocentricOrbit | None = None
    plasma_brake: PlasmaBrake | None = None
    event: Event | None = None
    output: Output | None = None
    voltage_law: Any = None
    terms: Any = ()

    def __post_init__(self):
        object.__setattr__(self, "terms", checked_terms(self.terms))
        if (self.chain is None) == (self.tethers is None):
            raise SceneError(
                "tethers", "be given, or `chain`", f"{'neither' if self.chain is None else 'both'} is"
            )
        if self.voltage_law is not None and self.voltage is None and self.solar_wind is not None:
            object.__setattr__(self, "voltage", Voltage(law="python"))
        object.__setattr__(self, self.main, checked(self.main, vars(self)[self.main], None))
        for table in self.tables:
            if table not in tables_of([self.main]):
                raise SceneError(table, f"be left out of a scene with [{self.main}]", "is given")
            kind, content = tables_of([self.main])[table], getattr(self, table)
            if not isinstance(content, kind):
                raise SceneError(table, f"be a {kind.__name__}", f"is a {type(content).__name__}")
            object.__setattr__(self, table, checked(table, getattr(self, table), self.members))
        if self.output is None:
            interval = self.integrator.t_end / 1000.0
            object.__setattr__(self, "output", Output(interval=interval))
        check_together(self)
        if self.chain is None and self.orbit is None and self.initial.heliocentric_position_au is None:
            start = dataclasses.replace(self.initial, heliocentric_position_au=ORIGIN_AU)
            object.__setattr__(self, "initial", start)

    @property
    def tables(self) -> dict[str, Any]:
        """The tables that the scene has, by name."""
        return {name: x for name, x in vars(self).items() if name in TABLES and x is not None}

    @property
    def main(self) -> str:
        """Name of the table that all scenes of this model have: `tethers` or `chain`."""
        return "tethers" if self.chain is None else "chain"

    @property
    def members(self) -> rules.Members:
        """The tethers or rods for each of which a list may have one number."""
        if self.chain is None:
            return rules.Members(self.tethers.count, "tether", "tethers.count")
        return rules.Members(self.chain.rods, "rod", "chain.rods")

    @property
    def sizes(self) -> dict[str, int]:
        """Lengths of the axes of its observables that depend on the scene, by name."""
        if self.chain is None:
            return {"tether": self.tethers.count, "node": self.tethers.elements + 1}
        return {"rod": self.chain.rods, "joint": self.chain.rods + 1}

    def replace(self, overrides: Mapping[str, Any]) -> "Scene":
        """The scene with other values, by key. A key of an absent table adds the table; the value None
        removes a key, or under a table's name the table. `voltage_law` is the key of a user's law: it takes
        the place of the law in [voltage], of which the keys `own_law.KEPT` stay. Raises SceneError."""
        tables = {name: given(content) for name, content in self.tables.items()}
        return scene_of(tables, overrides, Path(), self.voltage_law, self.terms)

    def __repr__(self) -> str:
        table, method = self.integrator, method_name(self) or "chosen when the scene is run"
        for name, unit in (("step", " s"), ("tolerance", "")):
            value = getattr(table, name)
            if value is not None:
                number = rules.known(value)
                method += f", {name} " + ("traced" if number is None else f"{float(number):g}{unit}")
        lines = [
            f"Scene: {', '.join(self.parts())}",
            f"method    {method}",
            f"end time  {table.t_end:g} s",
            f"interval  {self.output.interval:g} s",
        ]
        return "\n  ".join(lines)

    def _repr_html_(self) -> str:
        """The scene as a table of its keys, which a notebook shows."""
        rows = []
        for table, content in self.tables.items():
            for field in dataclasses.fields(content):
                value = getattr(content, field.name)
                if value is not None:
                    about = field.metadata["unit"], field.metadata["doc"]
                    rows.append(
                        (f"{table}.{field.name}", rules.describe(value).removeprefix("is "), *about)
                    )
        return html_table(repr(self), ("key", "value", "unit", "meaning"), rows)

    def parts(self) -> list[str]:
        """The parts of the model in words, the moving ones first."""
        if self.chain is not None:
            names = [f"{self.chain.anchor} chain of {count_of(self.chain.rods, 'rod')}"]
        else:
            tethers = self.tethers
            elements = count_of(tethers.elements, f"{tethers.element} element")
            names = [f"{count_of(tethers.count, 'tether')} of {elements}"]
        others = (
            "hub", "auxiliary_tethers", "remote_units", "solar_wind", "voltage", "tip_thrust", "thermal",
            "gravity", "orbit", "plasma_brake",
        )  # fmt: skip
        names += [name.replace("_", " ") for name in others if getattr(self, name) is not None]
        names += [] if self.voltage_law is None else [f"voltage law {type(self.voltage_law).__name__}"]
        names += [] if isinstance(self.terms, AbsentTerms) else [type(x).__name__ for x in self.terms]
        if self.event is not None:
            names.append(count_of(len(self.event.time), "event"))
        return names


def count_of(number: int, name: str) -> str:
    """A number of things in words: `1 rod`, `2 rods`."""
    return f"{number} {name}" + "s" * (number != 1)


def checked(table: str, content: Any, members: rules.Members | None) -> Any:
    """The table with every value in the form that the scene stores. Raises SceneError."""
    values = {}
    for field in dataclasses.fields(content):
        value = getattr(content, field.name)
        if value is not None:
            value = rules.check_value(f"{table}.{field.name}", value, rule_of(field), members)
        elif field.default is dataclasses.MISSING:
            raise SceneError(f"{table}.{field.name}", "be given", "is missing")
        values[field.name] = value
    return type(content)(**values)


def from_tables(tables: Mapping[str, Any], voltage_law: Any = None, terms: Any = ()) -> Scene:
    """A scene from nested mappings; a repeated table is one mapping of lists. Raises SceneError."""
    if "chain" in tables and "tethers" in tables:
        raise SceneError("chain", "be left out of a scene with [tethers]", "is given")
    parts, kinds = {}, tables_of(tables)
    for table, content in tables.items():
        if table in TABLES and table not in kinds:
            main = "chain" if "chain" in tables else "tethers"
            raise SceneError(table, f"be left out of a scene with [{main}]", "is given")
        if table not in kinds:
            raise unknown(table, kinds)
        if not isinstance(content, Mapping):
            raise SceneError(table, "be a table", rules.describe(content))
        for name in content:
            if name not in names_of(kinds[table]):
                raise unknown(f"{table}.{name}", kinds)
        for field in dataclasses.fields(kinds[table]):
            if field.default is dataclasses.MISSING and field.name not in content:
                raise SceneError(f"{table}.{field.name}", "be given", "is missing")
        parts[table] = kinds[table](**content)
    for table in ("tethers", "initial", "integrator"):
        if table in kinds and table not in parts:
            raise SceneError(f"{table}.{names_of(kinds[table])[0]}", "be given", "is missing")
    return Scene(**parts, voltage_law=voltage_law, terms=terms)


def scene_of(
    tables: Mapping[str, Any],
    overrides: Mapping[str, Any],
    folder: Path,
    voltage_law: Any = None,
    terms: Any = (),
) -> Scene:
    """A scene from the tables of a file and overrides by key. The overrides come before any check, so that
    they may give what the file lacks; a table's name with the value None removes the table before anything
    else. folder: where relative names of files in the tables start; voltage_law, terms: those of the user,
    of a scene that has them. Raises SceneError."""
    if OWN_TERMS in overrides:
        terms = overrides[OWN_TERMS]
        overrides = {key: x for key, x in overrides.items() if key != OWN_TERMS}
    if KEY in overrides:
        voltage_law = overrides[KEY]
        tables = with_own_law(dict(tables), voltage_law)
        overrides = {key: x for key, x in overrides.items() if key != KEY}
    removed = {key for key, value in overrides.items() if key in TABLES and value is None}
    tables, overrides = (
        {key: value for key, value in values.items() if key not in removed}
        for values in (tables, overrides)
    )
    return from_tables(merged(*with_wind_file(tables, overrides, folder)), voltage_law, terms)


def parse(text: str, source: str, overrides: Mapping[str, Any] | None = None) -> Scene:
    """A scene from TOML text and overrides by key. source: path of the text, which names it in errors.
    Raises SceneError."""
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # also numbers of thousands of digits
        raise SceneError(source, "be a TOML file", f"is not: {error}") from None
    return scene_of(tables, overrides or {}, Path(source).parent)


def unread(source: str | os.PathLike, error: Exception) -> str:
    """Says why a scene could not be read, and what its user may have meant."""
    from esail_jax.scenes.builtin_scenes import builtin_names

    if isinstance(error, FileNotFoundError):
        hint = nearest(str(source), builtin_names()) or " (`esail scenes` lists the built-in scenes)"
        return f"cannot be read: {error.strerror}{hint}"
    if isinstance(error, UnicodeDecodeError) and str(source).endswith(".h5"):
        return "cannot be read: is not text but a file of results"
    return f"cannot be read: {getattr(error, 'strerror', None) or 'is not text'}"


def read_scene(source: str | os.PathLike, overrides: Mapping[str, Any] | None) -> Scene:
    """A built-in scene by name or a TOML file by path, with overrides by key. Raises SceneError."""
    from esail_jax.scenes.builtin_scenes import builtin_text

    text = builtin_text(str(source))
    if text is None:
        try:
            with open(source, encoding="utf-8-sig") as file:  # some editors write a byte-order mark
                text = file.read()
        except (OSError, ValueError) as error:
            raise SceneError(
                str(source), "be a built-in scene or a TOML file", unread(source, error)
            ) from None
    return parse(text, str(source), overrides)
