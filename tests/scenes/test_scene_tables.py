"""Tables of a scene as Python objects: made by hand, described for documentation, removed; and the table of
methods that the checks read."""

import dataclasses
import re
import types
import typing
from typing import get_args

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.scenes import integration, method_choice, rules
from esail_jax.scenes.declarations import rule_of
from esail_jax.scenes.integration import METHODS, MethodName, takes
from esail_jax.scenes.key_reference import describe_keys
from esail_jax.scenes.loading import load_scene, parse
from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.overrides import STARTS
from esail_jax.scenes.parts import tables_of
from esail_jax.scenes.rules import Kind, Shape
from esail_jax.scenes.voltage import LAWS, LawName
from esail_jax.steppers.runge_kutta import REACH
from support import small_sail
from support.new_process import output_of

FIELDS = {
    f"{kind.__name__}.{field.name}": field
    for kind in {*tables_of("sail").values(), *tables_of("chain").values()}
    for field in dataclasses.fields(kind)
}

UNITS = {
    "-", "m", "m^2", "m^4", "kg", "kg m^2", "N m", "kg/m^3", "Pa", "s", "V", "V/s", "m/s", "m/s^2", "1/m^3",
    "deg", "rad", "rad/s", "au", "km", "km/s", "N", "W", "eV", "u", "K", "1/K",
    "1/s",
}  # fmt: skip


def small_tables() -> dict:
    """The tables of `small_sail.TEXT`, made in Python."""
    return {
        "hub": esail.Hub(height=2, radius=1, density=884),
        "tethers": esail.Tethers(
            count=2,
            length=10e3,
            area=4.28e-9,
            density=7653.0,
            youngs_modulus=70e9,
            elements=2,
            axial_damping_time=1.0,
        ),
        "remote_units": esail.RemoteUnits(mass=1.5),
        "solar_wind": esail.SolarWind(speed=4e5, number_density=7.3e6, cutoff_voltage=1e3),
        "voltage": esail.Voltage(value=20e3),
        "initial": esail.Initial(spin_rate=4e-3, sailing_angle_deg=10.0),
        "integrator": esail.Integrator(t_end=80, step=0.1),
        "output": esail.Output(interval=0.35),
    }


def test_a_sail_made_in_python_equals_that_of_a_file():
    assert esail.Scene(**small_tables()) == parse(small_sail.TEXT, "small")


def test_a_chain_made_in_python_equals_that_of_a_file():
    scene = esail.Scene(
        chain=esail.Chain(rods=20, mass=0.1, length=np.ones(20), area=1e-6, youngs_modulus=1e9),
        gravity=esail.Gravity((0, -9.81, 0)),
        initial=esail.ChainInitial(rod_vector=[0, -1, 0], rod_rate=(1.0, 0.0, 0.0)),
        integrator=esail.Integrator(t_end=5.0),
        output=esail.Output(0.01),
    )
    assert scene == load_scene("hanging-chain", {"chain.length": 20 * [1.0]})


def test_every_table_is_exported():
    for kind in {*tables_of("sail").values(), *tables_of("chain").values()}:
        assert getattr(esail, kind.__name__) is kind and kind.__name__ in esail.__all__


def test_numbers_of_tables_may_be_traced():
    def length(x):
        tables = small_tables()
        tables["tethers"] = dataclasses.replace(tables["tethers"], length=x)
        return esail.Scene(**tables).tethers.length.sum()

    assert jax.grad(length)(jnp.array([9e3, 1e4])).tolist() == [1.0, 1.0]


BAD = [
    ({"tethers.length": -3.0}, "`tethers.length` must be positive, but is -3.0"),
    (
        {"tethers.length": [1.0, 2.0, 3.0]},
        "`tethers.length` must be a number or a list of 2 (`tethers.count`), but has 3 entries",
    ),
    ({"tethers.count": "two"}, "`tethers.count` must be a positive integer, but is 'two'"),
    ({"tethers.element": "beam"}, '`tethers.element` must be "cable" or "truss", but is \'beam\''),
    ({"tethers.bending": 1}, "`tethers.bending` must be true or false, but is 1"),
    (
        {"tethers.bending": True},
        "`tethers.second_moment` must be given with `tethers.bending`, but is missing",
    ),
    ({"hub.height": None}, "`hub.height` must be given, but is missing"),
    (
        {"initial.sailing_angle_deg": -180},
        "`initial.sailing_angle_deg` must lie in (-180, 180], but is -180",
    ),
    (
        {"initial.heliocentric_position_au": 1.0},
        "`initial.heliocentric_position_au` must be a list of three numbers, but is 1.0",
    ),
    (
        {"integrator.tolerance": 1e-9},
        "`integrator.tolerance` must be left out with generalized-alpha, but is given",
    ),
    (
        {"integrator.method": "dopri8"},
        '`integrator.method` must be "generalized-alpha" or "energy-momentum" or "collocation" for a sail, '
        "but is 'dopri8'",
    ),
]


@pytest.mark.parametrize(("values", "message"), BAD, ids=lambda x: str(x)[:50])
def test_a_wrong_table_is_refused_with_the_message_of_a_wrong_file(values, message):
    """In a scene made in Python, and by an override of one from a file."""
    tables = small_tables()
    for key, value in values.items():
        table, _, name = key.partition(".")
        tables[table] = dataclasses.replace(tables[table], **{name: value})
    for make in (
        lambda: esail.Scene(**tables),
        lambda: parse(small_sail.TEXT, "small", values),
    ):
        with pytest.raises(esail.SceneError) as error:
            make()
        assert str(error.value) == message


def test_a_scene_says_what_it_is():
    scene = esail.Scene(**small_tables())
    assert repr(scene).splitlines() == [
        "Scene: 2 tethers of 2 cable elements, hub, remote units, solar wind, voltage",
        "  method    generalized-alpha, step 0.1 s",
        "  end time  80 s",
        "  interval  0.35 s",
    ]
    chain = load_scene("tethered-satellite")
    assert repr(chain).startswith(
        "Scene: free chain of 10 rods, orbit\n  method    chosen when the scene is run\n"
    )
    event = {"event.time": [5.0], "event.release": [1], "tethers.count": 1}
    assert "1 tether of" in repr(scene.replace(event)) and "voltage, 1 event\n" in repr(
        scene.replace(event)
    )
    seen = []
    jax.make_jaxpr(lambda x: seen.append(repr(chain.replace({"integrator.tolerance": x}))) or x)(1e-9)
    assert "tolerance traced" in seen[0]


# ---- removing tables ----------------------------------------------------------------------------


def test_none_removes_a_table():
    scene = esail.Scene(**small_tables())
    calm = scene.replace({"voltage": None, "solar_wind": None})
    assert calm == dataclasses.replace(scene, voltage=None, solar_wind=None)
    assert calm.replace({"gravity": None}) == calm, "an absent table stays absent"
    assert scene.replace({"voltage.value": 1.0, "voltage": None}).voltage == esail.Voltage(value=1.0)
    assert scene.replace({"output": None}).output.interval == 0.08


def test_none_removes_a_table_before_anything_of_it_is_read(tmp_path):
    file = small_sail.TEXT.replace("speed = 4e5\nnumber_density = 7.3e6", "file = 'missing.csv'")
    (tmp_path / "calm.toml").write_text(file)
    scene = load_scene(tmp_path / "calm.toml", {"solar_wind": None, "voltage": None})
    assert scene.solar_wind is None


def test_a_sail_can_become_a_chain():
    scene = esail.Scene(**small_tables())
    gone = dict.fromkeys(("tethers", "hub", "remote_units", "solar_wind", "voltage", "initial"))
    chain = {"rods": 1, "mass": 1.0, "length": 1.0, "area": 1.0, "youngs_modulus": 1.0}
    new = {f"chain.{key}": value for key, value in chain.items()} | {"initial.rod_vector": [1.0, 0.0, 0.0]}
    assert scene.replace(gone | new).chain == esail.Chain(**chain)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"voltage": None}, "`voltage.value` must be given with [solar_wind], but is missing"),
        ({"tethers": None}, "`tethers.count` must be given, but is missing"),
        ({"initial": None}, "`initial.spin_rate` must be given, but is missing"),
        ({"hubs": None}, "`hubs` must be a known key (perhaps `hub`), but is not"),
        ({"hub": 3.0}, "`hub` must be followed by a key of the table, but is the table's name"),
    ],
)
def test_removals_that_leave_no_scene_are_refused(overrides, message):
    with pytest.raises(esail.SceneError) as error:
        esail.Scene(**small_tables()).replace(overrides)
    assert str(error.value) == message


# ---- descriptions of the keys -------------------------------------------------------------------


@pytest.mark.parametrize("key", describe_keys(), ids=lambda key: f"{key.key} {'-'.join(key.models)}")
def test_every_key_is_described(key):
    assert key.unit in UNITS
    assert re.fullmatch(r"[A-Z].*\.", key.doc) and "\n" not in key.doc
    assert key.rule.startswith("must ") and key.type


def test_every_key_has_one_description_per_model():
    found = [(model, key.key) for key in describe_keys() for model in key.models]
    keys = [
        (model, f"{table}.{field.name}")
        for model, tables in (("sail", tables_of("sail")), ("chain", tables_of("chain")))
        for table, kind in tables.items()
        for field in dataclasses.fields(kind)
    ]
    of_files = [("sail", "solar_wind.file"), ("sail", "solar_wind.largest_gap")]
    of_files += [("sail", key) for key in STARTS]
    assert sorted(found) == sorted([*keys, *of_files])


def test_a_description_says_what_a_key_takes():
    (length,) = (key for key in describe_keys() if key.key == "tethers.length")
    assert (length.models, length.unit, length.required, length.traceable) == (("sail",), "m", True, True)
    assert length.type == "number, or list with one number per tether"
    (root,) = (key for key in describe_keys() if key.key == "chain.root")
    assert (root.type, root.default, root.required) == ('one of "pinned", "clamped"', "pinned", False)
    (end,) = (key for key in describe_keys() if key.key == "integrator.t_end")
    assert end.models == ("sail", "chain") and end.rule == "must be positive" and not end.traceable


ALIASES = {
    Shape.SCALAR: rules.Number, Shape.MEMBER: rules.PerMember, Shape.VECTOR: rules.Vector,
    Shape.VECTORS: rules.Vectors, Shape.SERIES: rules.Series, Shape.GRID: rules.Grid,
    Shape.HISTORY: rules.History, Shape.MATRIX: rules.Matrix,
}  # fmt: skip
"""Annotation of physical numbers of each shape."""


@pytest.mark.parametrize("name", sorted(FIELDS))
def test_annotations_agree_with_the_rules(name):
    field, rule = FIELDS[name], rule_of(FIELDS[name])
    wanted = ALIASES.get(rule.shape)
    if rule.kind is Kind.CHOICE:
        (wanted,) = (x for x in (field.type, *get_args(field.type)) if get_args(x) == rule.choices)
        assert typing.get_origin(wanted) is typing.Literal
    elif rule.kind is Kind.SWITCH:
        wanted = bool
    elif rule.kind is Kind.DATE:
        wanted = str
    elif rule.shape is Shape.LIST:
        wanted = typing.get_origin(field.type)[int if rule.kind is Kind.INTEGER else float]
    elif rule.structure:
        wanted = int if rule.kind is Kind.INTEGER else float
    assert field.type == (wanted | None if field.default is None else wanted)
    assert not isinstance(field.type, types.GenericAlias) or rule.shape is Shape.LIST


# ---- methods ------------------------------------------------------------------------------------


def test_names_of_methods_and_laws_agree_with_their_tables():
    assert get_args(MethodName) == tuple(METHODS)
    assert get_args(LawName) == tuple(LAWS)
    assert {name for name, method in METHODS.items() if method.explicit} == set(REACH)
    for method in METHODS.values():
        assert set(method.defaults) <= set(method.keys)


@pytest.fixture
def with_methods(monkeypatch):
    """Puts another table in place of METHODS."""

    def put(table):
        for module in (integration, method_choice):
            monkeypatch.setattr(module, "METHODS", table)

    return put


def test_a_method_without_an_entry_is_neither_checked_nor_completed(with_methods):
    """As a stepper from outside the package."""
    with_methods({name: x for name, x in METHODS.items() if name != "energy-momentum"})
    scene = esail.Scene(**small_tables())
    scene = scene.replace({"integrator.method": "energy-momentum", "integrator.step": None})
    given = scene.replace({"integrator.spectral_radius": 0.5, "integrator.tolerance": 1e-3})
    assert given.integrator.tolerance == 1e-3 and takes("energy-momentum", "anything")
    assert with_method(given) == given and with_method(scene) == scene
    chain = load_scene("hanging-chain", {"integrator.method": "energy-momentum"})
    assert with_method(chain) == chain


def test_a_method_without_events_is_refused_by_name(with_methods):
    with_methods(METHODS | {"collocation": dataclasses.replace(METHODS["collocation"], events=False)})
    overrides = {"event.time": [5.0], "event.release": [1], "integrator.step": None}
    with pytest.raises(esail.SceneError) as error:
        esail.Scene(**small_tables()).replace(overrides)
    must = 'be "generalized-alpha" or "energy-momentum" with events'
    assert str(error.value) == f"`integrator.method` must {must}, but is 'collocation'"


WRONG_KINDS = """
import esail_jax as esail
from esail_jax.scenes.loading import load_scene

good = vars(load_scene("truss"))
for make in (
    lambda: load_scene(1), lambda: load_scene(None), lambda: load_scene({}),
    lambda: load_scene("truss", {3: 4.0}),
    lambda: esail.Scene(**good | {"initial": None}), lambda: esail.Scene(**good | {"integrator": None}),
    lambda: esail.Scene(**good | {"tethers": {"count": 2}}),
    lambda: esail.Scene(**good | {"tethers": good["hub"]}),
):
    try:
        make()
    except esail.SceneError as error:
        print(error)
"""


def test_what_is_no_scene_is_refused():
    """In one line each. The number 1 would be taken for a file that is open, and closed. In a new process,
    as the types of arguments are checked in this one."""
    must = "`scene` must be a `Scene`, the name of a built-in scene, or the path of a TOML file, but is"
    assert output_of(WRONG_KINDS).splitlines() == [
        *(f"{must} {x}" for x in ("1", "None", "{}")),
        "`overrides` must have texts as keys, but has 3",
        "`initial` must be given, but is missing",
        "`integrator` must be given, but is missing",
        "`tethers` must be a Tethers, but is a dict",
        "`tethers` must be a Tethers, but is a Hub",
    ]


@pytest.mark.parametrize("value", [True, 2e4 + 1e4j])
def test_a_traced_value_that_is_no_real_number_is_refused(value):
    """As the same value is without a trace."""
    with pytest.raises(esail.SceneError, match=r"`tethers.length` must be a number .* of dtype"):
        jax.eval_shape(lambda x: load_scene("truss", {"tethers.length": x}).tethers.length, value)
