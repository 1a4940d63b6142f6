"""A scene: the parts of a model and their numbers, from the tables of a TOML file or made in Python.

A table that is `None` is an absent part of the model. Physical numbers may be JAX arrays, traced or
not; values that decide which program is compiled must be plain Python values.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from esail_jax.html import html_table
from esail_jax.scenes import rules
from esail_jax.scenes.control_period import check_one_clock
from esail_jax.scenes.declarations import rule_of
from esail_jax.scenes.integration import Output, method_name
from esail_jax.scenes.overrides import EXPANDERS, Request, unknown
from esail_jax.scenes.own_terms import AbsentTerms, check_own_terms, checked_terms
from esail_jax.scenes.parts import CHAIN, SAIL, field_of, given, model_of, names_of, parts_of, table_names
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.start_and_place import ORIGIN_AU
from esail_jax.scenes.tethers import Tethers
from esail_jax.scenes.voltage import Voltage, check_law_of_user

if TYPE_CHECKING:  # what `field_of` says of every table; a test compares the two
    from esail_jax.scenes.chain import Chain
    from esail_jax.scenes.deployment import ChainDeployment, Deployment
    from esail_jax.scenes.hub import Hub
    from esail_jax.scenes.integration import Integrator
    from esail_jax.scenes.plasma import ChainWind, PlasmaBrake, SolarWind
    from esail_jax.scenes.start_and_place import ChainInitial, Gravity, HeliocentricOrbit, Initial, Orbit
    from esail_jax.scenes.tethers import AuxiliaryTethers, Event, RemoteUnits, Thermal, TipThrust
    from esail_jax.scenes.voltage import ChainVoltage

    @dataclasses.dataclass(frozen=True, kw_only=True)
    class Tables:
        """The tables of a scene, with their types."""

        hub: Hub | None = None
        tethers: Tethers | None = None
        auxiliary_tethers: AuxiliaryTethers | None = None
        remote_units: RemoteUnits | None = None
        chain: Chain | None = None
        solar_wind: SolarWind | ChainWind | None = None
        voltage: Voltage | ChainVoltage | None = None
        tip_thrust: TipThrust | None = None
        deployment: Deployment | ChainDeployment | None = None
        thermal: Thermal | None = None
        gravity: Gravity | None = None
        orbit: Orbit | HeliocentricOrbit | None = None
        initial: Initial | ChainInitial
        integrator: Integrator
        event: Event | None = None
        output: Output | None = None
        plasma_brake: PlasmaBrake | None = None
else:
    Tables = dataclasses.make_dataclass("Tables", map(field_of, table_names()), frozen=True, kw_only=True)


@dataclasses.dataclass(frozen=True, kw_only=True, repr=False)
class Scene(Tables):
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

    voltage_law: Any = None
    terms: Any = ()

    def __post_init__(self):
        # The class is frozen; this is the one place where its values are replaced by what is checked.
        vars(self).update(terms=checked_terms(self.terms), **checked_tables(self))
        check_together(self)
        vars(self).update(initial=with_place(self))

    @property
    def tables(self) -> dict[str, Any]:
        """The tables that the scene has, by name."""
        return {name: getattr(self, name) for name in table_names() if self.has(name)}

    @property
    def model(self) -> str:
        """What is computed: a sail, or a chain of rods."""
        return SAIL if self.chain is None else CHAIN

    @property
    def members(self) -> rules.Members:
        """The tethers or rods for each of which a list may have one number."""
        return members_of(self.tethers if self.chain is None else self.chain)

    @property
    def sizes(self) -> dict[str, int]:
        """Lengths of the axes of its observables that depend on the scene, by name."""
        if self.chain is None:
            return {"tether": self.tethers.count, "node": self.tethers.elements + 1}
        return {"rod": self.chain.rods, "joint": self.chain.rods + 1}

    def replace(self, overrides: Mapping[str, Any]) -> "Scene":
        """The scene with other values, by key. A key of an absent table adds the table; the value None
        removes a key, or under a table's name the table. `voltage_law` is the key of a user's law: it takes
        the place of the law in [voltage], of which the keys `voltage.KEPT` stay. Raises SceneError."""
        tables = {name: given(content) for name, content in self.tables.items()}
        return scene_of(Request(tables, overrides, Path(), self.voltage_law, self.terms))

    def has(self, need: str) -> bool:
        """Tells whether the scene has this table, or a value of this key."""
        table, _, name = need.partition(".")
        content = getattr(self, table, None)
        return content is not None and (not name or getattr(content, name, None) is not None)

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
        main = "tethers" if self.chain is None else "chain"
        parts = sorted(parts_of(self.model).values(), key=lambda part: part.name != main)
        names = [part.named(getattr(self, part.name)) for part in parts if self.has(part.name)]
        names += [] if self.voltage_law is None else [f"voltage law {type(self.voltage_law).__name__}"]
        names += [] if isinstance(self.terms, AbsentTerms) else [type(x).__name__ for x in self.terms]
        return [name for name in names if name]


def members_of(main: Any) -> rules.Members:
    """The tethers or rods of the table that all scenes of a model have."""
    if isinstance(main, Tethers):
        return rules.Members(main.count, "tether", "tethers.count")
    return rules.Members(main.rods, "rod", "chain.rods")


def checked_tables(scene: Scene) -> dict[str, Any]:
    """The tables of a scene with every value in the form that the scene stores, and with those that follow
    from others: the voltage of a user's law, and the saved instants. Raises SceneError."""
    if (scene.chain is None) == (scene.tethers is None):
        neither = f"{'neither' if scene.chain is None else 'both'} is"
        raise SceneError("tethers", "be given, or `chain`", neither)
    tables, kinds = scene.tables, parts_of(scene.model)
    for part in kinds.values():
        content = getattr(scene, part.name)
        if part.required and content is None:
            raise SceneError(part.name, "be given", "is missing")
        if content is not None and not isinstance(content, part.table):
            raise SceneError(part.name, f"be a {part.table.__name__}", f"is a {type(content).__name__}")
    if scene.voltage_law is not None and scene.solar_wind is not None:
        tables.setdefault("voltage", Voltage(law="python"))
    main = "tethers" if scene.chain is None else "chain"
    members = members_of(checked(main, tables[main], None))
    for table, content in tables.items():
        if table not in kinds:
            raise SceneError(table, f"be left out of a scene with [{main}]", "is given")
        tables[table] = checked(table, content, members)
    tables.setdefault("output", Output(interval=tables["integrator"].t_end / 1000.0))
    return tables


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


def check_together(scene: Scene) -> None:
    """Checks all conditions that several keys of a scene must satisfy together. Raises SceneError for the
    first one that does not hold."""
    for part in parts_of(scene.model).values():
        if part.check is not None and scene.has(part.name):
            part.check(scene)
    if scene.voltage_law is not None:
        check_law_of_user(scene)
    check_own_terms(scene)
    check_one_clock(scene)


def with_place(scene: Scene) -> Any:
    """The table [initial]: that of a sail which has neither a position nor an orbit says where it is."""
    if scene.chain is not None or scene.orbit is not None:
        return scene.initial
    if scene.initial.heliocentric_position_au is not None:
        return scene.initial
    return dataclasses.replace(scene.initial, heliocentric_position_au=ORIGIN_AU)


def from_tables(tables: Mapping[str, Any], voltage_law: Any = None, terms: Any = ()) -> Scene:
    """A scene from nested mappings; a repeated table is one mapping of lists. Raises SceneError."""
    model, parts = model_of(tables), {}
    if "chain" in tables and "tethers" in tables:
        raise SceneError("chain", "be left out of a scene with [tethers]", "is given")
    kinds = parts_of(model)
    for table, content in tables.items():
        if table in table_names() and table not in kinds:
            main = "chain" if "chain" in tables else "tethers"
            raise SceneError(table, f"be left out of a scene with [{main}]", "is given")
        if table not in kinds:
            raise unknown(table, model)
        if not isinstance(content, Mapping):
            raise SceneError(table, "be a table", rules.describe(content))
        kind = kinds[table].table
        for name in content:
            if name not in names_of(kind):
                raise unknown(f"{table}.{name}", model)
        for field in dataclasses.fields(kind):
            if field.default is dataclasses.MISSING and field.name not in content:
                raise SceneError(f"{table}.{field.name}", "be given", "is missing")
        parts[table] = kind(**content)
    for part in kinds.values():
        if (part.required or part.name == "tethers") and part.name not in parts:
            raise SceneError(f"{part.name}.{names_of(part.table)[0]}", "be given", "is missing")
    return Scene(**parts, voltage_law=voltage_law, terms=terms)


def scene_of(request: Request) -> Scene:
    """The scene that is asked for. A table's name with the value None removes the table before anything
    else. Raises SceneError."""
    removed = {name for name in table_names() if request.overrides.get(name, ...) is None}
    tables, overrides = (
        {key: value for key, value in values.items() if key not in removed}
        for values in (request.tables, request.overrides)
    )
    request = request._replace(tables=tables, overrides=overrides)
    for expand in EXPANDERS:
        request = expand(request)
    return from_tables(request.tables, request.voltage_law, request.terms)


# ---- releases ---------------------------------------------------------------------------------


def released(scene: Scene, time: np.ndarray) -> np.ndarray:
    """Tells which tethers of a sail are released at saved instants [s] (instant, tether)."""
    free = np.zeros((len(time), scene.tethers.count), np.bool_)
    event = scene.event
    if event is not None:
        for instant, number in zip(np.atleast_1d(event.time), np.atleast_1d(event.release), strict=True):
            free[:, int(number) - 1] |= time >= instant
    return free


def releases(scene: Scene) -> dict[float, list[int]]:
    """The numbers of the tethers that are released, from 1, by the instant [s] of their release, in
    the order of the instants."""
    tethers: dict[float, list[int]] = {}
    event = scene.event
    if event is not None:
        pairs = zip(np.atleast_1d(event.time), np.atleast_1d(event.release), strict=True)
        for instant, number in sorted((float(time), int(tether)) for time, tether in pairs):
            tethers.setdefault(instant, []).append(number)
    return tethers
