"""One registration per part: what a scene, its keys, its files, its runs and their derivatives know of a
part follows from its entry in `PARTS`."""

import ast
import dataclasses
import os
import sys
from importlib import import_module
from pathlib import Path

import pytest

import esail_jax as esail
from esail_jax.scenes.parts import PARTS, field_of, parts_of, table_names
from support.new_process import output_of

SCENES = Path(esail.__file__).parent / "scenes"

DUMMY = '''
import jax.numpy as jnp

from esail_jax.array_types import Array
from esail_jax.scenes import parts
from esail_jax.scenes.declarations import declare, table, vector
from esail_jax.scenes.rules import Number, SceneError, Vector, any_number
from esail_jax.terms import HubLoad, Terms


@table
class Jet:
    """A force on the hub in inertial axes, which grows from an instant on."""

    force: Vector = vector(unit="N/s", doc="Growth of the force on the hub.")
    on: Number = declare(any_number, unit="s", doc="Instant at which the force begins.", default=0.0)


class Push(HubLoad):
    force: Array
    on: Array
    name = "jet"

    def wrench(self, hub):
        return jnp.maximum(hub.time - self.on, 0.0) * self.force, jnp.zeros(3)


def check(scene):
    if scene.hub is None:
        raise SceneError("jet", "be left out without [hub]", "is given")


def terms(structure, n):
    return Terms(hub_loads=(Push(n["jet.force"], n["jet.on"]),))


parts.PARTS += (parts.Part("jet", Jet, ("sail",), check=check, switches=("on",), terms="dummy:terms"),)
'''

USE = """
import dummy
import esail_jax as esail
from esail_jax.scenes.build import build
from esail_jax.scenes.key_reference import describe_keys
from esail_jax.scenes.loading import builtin_text, load_scene, parse
from esail_jax.scenes.structure import split
from esail_jax.scenes.toml_text import commented, to_toml
from esail_jax.simulation.schedule import switch_times

base = {"tethers.count": 2, "tethers.elements": 1, "solar_wind": None, "voltage": None,
        "integrator.t_end": 4.0, "output.interval": 2.0}
scene = load_scene("truss", base | {"jet.force": [0.0, 3.0, 0.0], "jet.on": 2.0})
assert scene.jet.force == (0.0, 3.0, 0.0) and "jet" in scene.parts()
assert parse(to_toml(scene), "text") == scene
assert {key.key for key in describe_keys()} >= {"jet.force", "jet.on"}
assert "# [jet]" in commented(builtin_text("truss"))
assert switch_times(scene) == (2.0,)
for overrides, message in (
    ({"jet.force": [1.0]}, "`jet.force` must be a list of three numbers, but is [1.0]"),
    ({"jet.forse": 1.0}, "`jet.forse` must be a known key (perhaps `jet.force`), but is not"),
    ({"hub": None}, "`jet` must be left out without [hub], but is given"),
):
    try:
        scene.replace(overrides)
    except esail.SceneError as error:
        assert str(error) == message, error
    else:
        raise AssertionError(message)

system = build(*split(scene)).system
assert "jet" in system.terms and system.hub_loads[0].name == "jet"
"""

RUN = """
import jax
import jax.numpy as jnp
def gained(size):
    run = esail.simulate(scene, {"jet.force": size * jnp.array([0.0, 1.0, 0.0])})
    return run["total_momentum_I"][-1, 1] - run["total_momentum_I"][1, 1]

momentum, rate = jax.jit(lambda size: jax.jvp(gained, (size,), (1.0,)))(3.0)
assert abs(momentum - 6.0) < 1e-9 and abs(rate - 2.0) < 1e-9, (momentum, rate)
run = esail.simulate(scene)
before, after = run["total_momentum_I"][1:, 1]
assert abs(before) < 1e-4 and abs(after - before - 6.0) < 1e-9, (before, after)
assert abs(run["energy_balance_error"][-1]) < 1e-9 * run["kinetic_energy"][-1]
"""


def test_fields_for_type_checkers_are_those_of_the_parts():
    """Type checkers read the fields of a scene where programs do not (`scene.py`, `Tables`): name, types
    and whether a table must be given are those of `PARTS`."""
    tree = ast.parse((SCENES / "scene.py").read_text(encoding="utf-8"))
    (tables,) = [x for x in ast.walk(tree) if isinstance(x, ast.ClassDef) and x.name == "Tables"]
    written = {
        x.target.id: ({*ast.unparse(x.annotation).split(" | ")} - {"None"}, x.value is None)
        for x in tables.body
        if isinstance(x, ast.AnnAssign)
    }
    expected = {}
    for name in table_names():
        entries = [part for part in PARTS if part.name == name]
        expected[name] = {part.table.__name__ for part in entries}, len(field_of(name)) == 2
    assert written == expected
    assert [field.name for field in dataclasses.fields(esail.Scene)][:-2] == list(table_names())


def test_tables_have_public_names():
    for part in PARTS:
        assert getattr(esail, part.table.__name__) is part.table


@pytest.mark.parametrize("part", [part for part in PARTS if part.terms], ids=lambda part: part.terms)
def test_what_builds_the_terms_of_a_part_exists(part):
    module, _, function = part.terms.partition(":")
    assert callable(getattr(import_module(module), function))


def test_every_model_has_one_part_of_a_name():
    for model in ("sail", "chain"):
        entries = [part.name for part in PARTS if model in part.models]
        assert entries == list(parts_of(model))


def use_dummy(tmp_path, code):
    """Runs code in a process in which the dummy part is registered."""
    (tmp_path / "dummy.py").write_text(DUMMY, encoding="utf-8")
    output_of(code, PYTHONPATH=os.pathsep.join([str(tmp_path), *filter(None, sys.path)]))


def test_a_new_part_is_one_registration_and_one_table(tmp_path):
    """[jet], a part that exists in this test only: one class for the table, one entry of `PARTS` with a
    check, an instant at which the stepper starts anew, and a function that builds its term. Overrides,
    messages, TOML text, documentation, words, switch times and the list of terms follow."""
    use_dummy(tmp_path, USE)


@pytest.mark.nightly
def test_a_new_part_moves_the_sail(tmp_path):
    """The momentum of the sail grows by f t^2/2, and so does its forward derivative; both are exact for
    collocation. Before the part acts, the momentum is that which the iteration leaves, 1e-6 of that of a
    remote unit. The energy is balanced: the power of the part is counted."""
    use_dummy(tmp_path, USE + RUN)
