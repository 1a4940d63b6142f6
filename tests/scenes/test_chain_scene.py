"""Scenes of rod chains, from scene file to run file: keys, refused input, resuming, and `esail info`."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax import cli
from esail_jax.files import run_file
from esail_jax.scenes.declarations import rule_of
from esail_jax.scenes.loading import load_scene, parse
from esail_jax.scenes.parts import tables_of
from esail_jax.scenes.rules import Shape
from esail_jax.scenes.start_and_place import Initial
from esail_jax.scenes.toml_text import to_toml
from esail_jax.simulation.host import HostRun
from support import small_chain
from support.bits import check_same, esail_run, status_of
from support.quick import jit

FIELDS = {
    f"{table}.{field}": rule_of(content.__dataclass_fields__[field])
    for table, content in tables_of("chain").items()
    for field in content.__dataclass_fields__
}


@pytest.fixture(scope="module")
def chain():
    return parse(small_chain.TEXT, "chain")


EQUAL = {"chain.mass": 0.1, "deployment.start_length": 1.4}
PAID_OUT = EQUAL | {"deployment.time": (0.0, 1.0), "deployment.rate": (0.0, 0.0625)}

NEEDS = {
    **{f"deployment.{x}": PAID_OUT for x in ("start_length", "law", "time", "rate")},
    "deployment.growth": EQUAL | {"deployment.law": "exponential"},
    "chain.base_mass": {"chain.anchor": "free"}, "initial.position": {"chain.anchor": "free"},
    "initial.velocity": {"chain.anchor": "free"}, "chain.bending": {"chain.second_moment": 1e-12},
    "chain.root": {"chain.bending": True, "chain.second_moment": 1e-12},
    "integrator.spectral_radius": {"integrator.method": "generalized-alpha"},
    "solar_wind.speed": {"voltage.value": 1e3}, "solar_wind.number_density": {"voltage.value": 1e3},
    "solar_wind.cutoff_voltage": {"voltage.value": 1e3}, "voltage.value": {},
    "solar_wind.relative": {"voltage.value": 1e3}, "solar_wind.thrust_factor": {"voltage.value": 1e3},
    "initial.heliocentric_position_au": {"voltage.value": 1e3},
    **{f"plasma_brake.{x}": {"orbit.mean_motion": 1e-3, "plasma_brake.speed": 7.5e3,
       "plasma_brake.voltage": -1e3, "plasma_brake.number_density": 3e10,
       "plasma_brake.tether_radius": 1e-3} for x in ("speed", "voltage", "number_density",
       "tether_radius", "ion_mass_u")},
}  # fmt: skip
"""The keys that a key requires."""

WIND = {
    "solar_wind.speed": 4e5, "solar_wind.number_density": 7e6, "solar_wind.cutoff_voltage": 1e3,
    "initial.heliocentric_position_au": (1.0, 0.0, 0.0),
}  # fmt: skip


def with_key(key, value):
    """The least overrides that make a key legal."""
    needed = dict(NEEDS.get(key, {}))
    if "voltage.value" in (*needed, key):
        needed |= WIND
    return needed | {key: value}


@pytest.mark.parametrize("key", FIELDS)
def test_every_key_can_be_given_and_written(key, chain):
    """A given value is unchanged in the scene and in the scene that its TOML gives."""
    values = {
        "chain.rods": 3, "chain.anchor": "free", "chain.strain": "green-lagrange", "chain.bending": True,
        "chain.root": "clamped", "integrator.method": "dopri5", "integrator.tolerance": 0.125,
        "solar_wind.relative": True, "plasma_brake.voltage": -1e3, "deployment.start_length": 1.375,
        "deployment.law": "table", "deployment.time": (0.0, 2.0), "deployment.rate": (0.0, 0.125),
        "deployment.growth": 0.0625, "initial.epoch": "2027-03-01T12:00:00 TDB",
    }  # fmt: skip
    shape = (1.0, 2.0, 0.5) if FIELDS[key].shape in (Shape.VECTOR, Shape.VECTORS) else 0.125
    value = values.get(key, shape)
    scene = chain.replace(with_key(key, value))
    table, _, name = key.partition(".")
    assert getattr(getattr(scene, table), name) == value
    assert parse(to_toml(scene), "again") == scene


PLAIN = ("deployment.time",)
"""Numbers that are not traced: they say where the run is divided."""


@pytest.mark.parametrize(
    "key", [key for key, rule in FIELDS.items() if not rule.structure and key not in PLAIN]
)
def test_every_number_may_be_traced(key, chain, monkeypatch):
    """A traced number reaches the program of the traced run, which takes it as an argument."""
    like = jnp.ones(3) if FIELDS[key].shape in (Shape.VECTOR, Shape.VECTORS) else jnp.asarray(0.125)
    like = jnp.array([0.0, 0.125]) if key == "deployment.rate" else like
    seen = []

    def run(structure, schedule, names, numbers, *more):
        seen.append(numbers[key])
        raise StopIteration

    monkeypatch.setattr("esail_jax.simulation.under_trace.traced_run", run)
    with pytest.raises(StopIteration):
        jax.make_jaxpr(lambda x: esail.simulate(chain, with_key(key, x)).time)(like)
    assert isinstance(seen[0], jax.core.Tracer)


REFUSED = [
    ({"chain.rods": 0}, "chain.rods", "positive integer"),
    ({"chain.mass": 0.0}, "chain.mass", "positive"),
    ({"chain.mass": [0.1, 0.2]}, "chain.mass", "3 (`chain.rods`)"),
    ({"chain.length": [0.5, -0.5, 0.5]}, "chain.length", "positive"),
    ({"chain.tip_mass": -1.0}, "chain.tip_mass", "negative"),
    ({"chain.anchor": "loose"}, "chain.anchor", '"fixed" or "free"'),
    ({"chain.slack_strain": 0.0}, "chain.slack_strain", "(0, 1)"),
    ({"chain.slack_strain": 2.5}, "chain.slack_strain", "(0, 1)"),
    ({"chain.base_mass": 1.0}, "chain.base_mass", '"free"'),
    ({"initial.position": [0.0, 0.0, 1.0]}, "initial.position", '"free"'),
    ({"chain.bending": True}, "chain.second_moment", "missing"),
    ({"chain.root": "clamped"}, "chain.root", "chain.bending"),
    (
        {"chain.bending": True, "chain.second_moment": 1.0, "integrator.method": "generalized-alpha"},
        "integrator.method", "explicit",
    ),
    ({"initial.rod_vector": [0.0, 0.0, 0.0]}, "initial.rod_vector", "zero"),
    ({"initial.rod_vector": [[1.0, 0.0, 0.0]] * 2}, "initial.rod_vector", "3 (`chain.rods`)"),
    ({"initial.rod_vector": [1.0, 0.0]}, "initial.rod_vector", "three numbers"),
    ({"initial.rod_rate": 1.0}, "initial.rod_rate", "three numbers"),
    ({"initial.spin_rate": 1.0}, "initial.spin_rate", "known key"),
    ({"hub.height": 1.0}, "hub.height", "known key"),
    ({"integrator.method": "rk4"}, "integrator.method", '"dopri8"'),
    ({"integrator.tolerance": 0.0}, "integrator.tolerance", "[1e-16, 1)"),
    ({"integrator.tolerance": 1e-6, "integrator.step": 1e-3}, "integrator.tolerance", "fixed"),
    (
        {"integrator.method": "dopri5", "integrator.spectral_radius": 0.5},
        "integrator.spectral_radius", "left out",
    ),
    (
        {"integrator.method": "generalized-alpha", "integrator.tolerance": 1e-6},
        "integrator.tolerance", "left out",
    ),
    ({"voltage.value": 1e3}, "solar_wind.speed", "[voltage]"),
    (
        {"voltage.value": 1e3} | WIND | {"initial.heliocentric_position_au": None},
        "initial.heliocentric", "missing",
    ),
    ({"initial.heliocentric_position_au": [1.0, 0.0, 0.0]}, "initial.heliocentric", "left out"),
    ({"orbit.mean_motion": 0.0}, "orbit.mean_motion", "positive"),
]  # fmt: skip


@pytest.mark.parametrize(("settings", "key", "word"), REFUSED, ids=lambda x: str(x)[:40])
def test_bad_input_is_refused_by_name(settings, key, word, chain, nothing_compiles):
    """A bad value is refused by the name of its key before anything is compiled."""
    settings = {k: v for k, v in settings.items() if v is not None}
    with pytest.raises(esail.SceneError) as error:
        esail.simulate(chain, settings)
    line = str(error.value)
    assert line.startswith(f"`{key}") and word in line and " must " in line and ", but " in line


def test_tables_of_sails_do_not_mix_with_a_chain():
    for table in ("hub", "remote_units", "tethers"):
        with pytest.raises(esail.SceneError, match="be left out of a scene with"):
            parse(small_chain.TEXT + f"[{table}]\n", "mixed")
    with pytest.raises(esail.SceneError, match=r"`initial\.rod_vector` must be given"):
        parse(small_chain.TEXT.replace("rod_vector", "# "), "without")


def test_contracts_chains_are_built_in():
    """The built-in chains have exactly the numbers of [MW] Sec. 3."""
    hanging, steel = load_scene("hanging-chain"), load_scene("steel-chain")
    assert (hanging.chain.rods, hanging.chain.mass, hanging.chain.length) == (20, 0.1, 1.0)
    assert hanging.chain.area * hanging.chain.youngs_modulus == 1e3
    assert (hanging.initial.rod_vector, hanging.initial.rod_rate) == ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0))
    assert (hanging.integrator.t_end, steel.integrator.t_end) == (5.0, 1.0)
    assert (steel.chain.rods, steel.chain.length, steel.initial.rod_vector) == (11, 0.1, (0.0, -0.1, 0.0))
    np.testing.assert_allclose(steel.chain.mass, 7801 * np.pi * 1e-3**2 * 0.1, rtol=1e-15)
    np.testing.assert_allclose(steel.chain.area, np.pi * 1e-3**2, rtol=1e-15)


# ---- run files ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("chain") / "chain.toml"
    path.write_text(small_chain.TEXT)
    return path


@pytest.fixture(scope="module")
def whole(file, tmp_path_factory):
    path = tmp_path_factory.mktemp("chain-run") / "whole.h5"
    assert esail_run(file, path) == 0
    return path


def test_a_run_file_holds_what_simulate_gives(whole, chain, capsys):
    solution, loaded = esail.simulate(chain), esail.load(whole)
    assert status_of(whole) == "complete" and loaded.scene == chain
    assert set(loaded.observables) == {
        "joint_position", "tension", "kinetic_energy", "elastic_energy", "potential_energy", "energy_error",
    }  # fmt: skip
    assert loaded["joint_position"].shape == (51, 4, 3) and loaded["tension"].shape == (51, 3)
    for name in loaded.observables:
        np.testing.assert_array_equal(loaded[name], solution[name])
    energy = loaded["kinetic_energy"] + loaded["elastic_energy"] + loaded["potential_energy"]
    size = np.maximum(abs(energy[0]), np.maximum.accumulate(loaded["kinetic_energy"]))
    np.testing.assert_allclose(loaded["energy_error"], (energy - energy[0]) / size, atol=1e-15)
    assert loaded.stats["terms"] == ("fixed anchor", "rods", "axial", "gravity")
    assert cli.main(["info", str(whole)]) == 0
    said = capsys.readouterr().out
    assert "3 rods" in said and "dopri8, tolerance 1e-09 (chosen)" in said and "E_0" in said


def tip(point):
    """The position of the last joint in a point of the motion of a chain."""
    return np.asarray(point.q.tether)[0, :, -1, 0]


def test_the_final_state_is_that_of_the_last_row(chain, tmp_path):
    """The final state of a concrete and of a traced run is that of the last row.

    t_end is no multiple of the interval.
    """
    ends = {"integrator.t_end": 0.35, "output.interval": 0.1, "integrator.method": "tsit5"}
    solution = esail.simulate(chain, ends)
    assert solution.final_state.time == 0.35
    np.testing.assert_allclose(tip(solution.final_state), solution["joint_position"][-1, -1], atol=1e-15)
    run = jit(lambda mass: esail.simulate(chain, ends | {"chain.mass": mass}).final_state)
    traced = run(jnp.array([0.1, 0.2, 0.1]))
    for x, y in zip(jax.tree.leaves(traced), jax.tree.leaves(solution.final_state), strict=True):
        np.testing.assert_allclose(x, y, atol=1e-12)
    esail.save(solution, tmp_path / "a.h5")
    loaded = esail.load(tmp_path / "a.h5")
    np.testing.assert_array_equal(tip(loaded.final_state), tip(solution.final_state))


def test_tables_of_the_wrong_kind_are_refused(chain):
    initial = Initial(spin_rate=1.0)
    with pytest.raises(esail.SceneError, match="`initial` must be a ChainInitial, but is a Initial"):
        dataclasses.replace(chain, initial=initial)


@pytest.mark.nightly
def test_a_failed_run_keeps_its_cause_and_a_traced_one_its_nan(chain, tmp_path, capsys):
    """A run with an energy drift keeps its message, result code and status in the file, and `info` shows
    them."""
    hard = {"integrator.tolerance": 0.9, "integrator.method": "dopri5", "integrator.t_end": 50.0}
    failed = esail.simulate(chain, hard, throw=False)
    assert failed.result == esail.RESULTS.energy_drift and "energy balance" in failed.stats["message"]
    assert failed.steps > 0
    esail.save(failed, tmp_path / "a.h5")
    assert esail.load(tmp_path / "a.h5").result == esail.RESULTS.energy_drift
    traced = jit(lambda g: esail.simulate(chain, hard | {"gravity.acceleration": g}))
    traced = traced(jnp.array([0.0, -9.81, 0.0]))
    assert traced.result == esail.RESULTS.energy_drift
    assert np.isnan(tip(traced.final_state)).all()
    damped = esail.simulate(chain, {"chain.axial_damping_time": 0.01, "integrator.method": "tsit5"})
    esail.save(damped, tmp_path / "b.h5")
    assert cli.main(["info", str(tmp_path / "b.h5")]) == 0
    said = capsys.readouterr().out
    assert "|dE - W + D|" in said and "axial damping" in said


def test_energies_and_tension_of_a_state_by_hand(chain):
    """At the start T = m/6 (u^2 + u.w + w^2) and U = EA (l' - l)^2/(2 l) per rod; V follows from the rods'
    middles."""
    scene = chain.replace({"initial.rod_vector": [[0.0, -0.51, 0.0], [0.0, -0.5, 0.0], [0.49, 0.0, 0.0]]})
    start = {name: x[0] for name, x in esail.simulate(scene).items()}
    speeds, mass = np.arange(4.0), np.array([0.1, 0.2, 0.1])
    kinetic = (mass / 6 * (speeds[:-1] ** 2 + speeds[:-1] * speeds[1:] + speeds[1:] ** 2)).sum()
    np.testing.assert_allclose(start["kinetic_energy"], kinetic, rtol=1e-13)
    np.testing.assert_allclose(start["elastic_energy"], 2 * 1e3 * 0.01**2 / (2 * 0.5), rtol=1e-10)
    heights = np.array([-0.255, -0.76, -1.01])
    np.testing.assert_allclose(start["potential_energy"], 9.81 * (mass * heights).sum(), rtol=1e-13)
    np.testing.assert_allclose(start["tension"], [20.0, 0.0, -20.0], atol=1e-10)
    np.testing.assert_allclose(start["joint_position"][-1], [0.49, -1.01, 0.0], atol=1e-15)
    assert start["energy_error"] == 0.0


@pytest.mark.nightly
def test_a_run_cut_short_goes_on_bit_for_bit(file, whole, tmp_path, monkeypatch):
    """The run ends at a saved instant, at another instant, or after a compiled call."""
    for t_end in (0.42, 0.43):
        path = tmp_path / f"{t_end}.h5"
        assert esail_run(file, path, "--t-end", t_end) == 0
        assert run_file.load(path).time[-1] == t_end
        assert esail_run(file, path, "--resume") == 0
        check_same(path, whole)
    path = tmp_path / "interrupted.h5"
    chunks = HostRun.chunks

    def interrupted(self):
        for number, chunk in enumerate(chunks(self)):
            yield chunk
            if number == 0:
                raise esail.SimulationError("stopped", esail.RESULTS.nonfinite)

    with monkeypatch.context() as patch:
        patch.setattr(HostRun, "chunks", interrupted)
        assert esail_run(file, path) == 3
    assert status_of(path) == "failed"
    assert esail_run(file, path, "--resume") == 0
    check_same(path, whole)


@pytest.mark.nightly
def test_the_implicit_method_resumes_too(file, tmp_path):
    implicit = ("--set", "integrator.method=generalized-alpha", "--set", "integrator.step=1e-3")
    path, again = tmp_path / "implicit.h5", tmp_path / "again.h5"
    assert esail_run(file, path, *implicit) == 0
    assert esail_run(file, again, *implicit, "--t-end", "0.5") == 0
    assert esail_run(file, again, *implicit, "--resume") == 0
    check_same(again, path)
    assert esail_run(file, again, "--resume") == 2, "another method is another scene"


def test_load_compiles_nothing(whole, nothing_compiles):
    assert esail.load(whole)["tension"].shape == (51, 3)


HEAT = esail.Thermal(expansion=2e-5, reference_temperature=300.0, temperature=250.0)


@pytest.mark.parametrize("table", [{"tip_thrust": esail.TipThrust(force=1.0)}, {"thermal": HEAT}])
def test_tables_of_a_sail_are_refused(table, nothing_compiles):
    """A chain has no remote units that could push, and its rods have no temperature."""
    (name,) = table
    with pytest.raises(esail.SceneError, match=rf"`{name}` must be left out of a scene with \[chain\]"):
        esail.Scene(
            chain=esail.Chain(rods=2, mass=0.1, length=1.0, area=1e-6, youngs_modulus=1e9),
            initial=esail.ChainInitial(rod_vector=[0, -1, 0]),
            integrator=esail.Integrator(t_end=1.0),
            **table,
        )
