"""Scenes: built-in scenes, TOML, overrides by key, tracers and precision."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.elements.bending import BendingDissipation
from esail_jax.scenes.build import material_terms
from esail_jax.scenes.loading import builtin_names, builtin_text, description, load_scene, parse
from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.parts import names_of, tables_of
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.structure import split
from esail_jax.scenes.toml_text import to_toml
from esail_jax.terms import find_term
from support import small_sail

SAIL_TABLES = tables_of("sail").items()
SAIL_KEYS = [f"{table}.{name}" for table, content in SAIL_TABLES for name in names_of(content)]
SAIL_KEYS.remove("integrator.tolerance")  # a key of the explicit methods, which run only chains

STRUCTURE = (
    "tethers.count", "tethers.elements", "tethers.element", "tethers.strain", "tethers.bending",
    "tethers.root", "integrator.method", "integrator.step", "integrator.t_end", "output.interval",
    "initial.elongation", "event.time", "event.release", "voltage.law",
    "auxiliary_tethers.element", "auxiliary_tethers.elements", "auxiliary_tethers.strain",
    "tethers.wires", "solar_wind.relative", "solar_wind.thrust_law", "tip_thrust.direction",
    "voltage.measured_axis",
)  # fmt: skip
"""Keys that determine the structure, the saved instants or the events, and so cannot be traced."""

EVENT = {"event.time": (5.0,), "event.release": (1,)}
"""Keys that require each other."""

HEAT = {"thermal.expansion": 2e-5, "thermal.reference_temperature": 300.0, "thermal.temperature": 250.0}
PULSE = {"tip_thrust.force": 1e-3, "tip_thrust.on": 0.0, "tip_thrust.off": 5.0, "tip_thrust.rise_time": 1.0}
WAVES = {"voltage.law": "harmonic", "voltage.cosine": (0.1,)}
TABLE = {"voltage.law": "piecewise-linear", "voltage.time": (0.0, 5.0), "voltage.table": (0.5, 1.0)}
SWITCH = {"voltage.law": "on-off", "voltage.on": 1.0, "voltage.rise_time": 1.0}
FEEDBACK = {"voltage.law": "feedback", "voltage.gain": 1.0, "voltage.target_sailing_angle_deg": 5.0}
CONE = {"voltage.law": "planar-cone", "voltage.value": None, "voltage.coning_angle_deg": 3.0}
CONE |= {"voltage.spin_rate": 4e-3, "hub.height": None, "hub.radius": None, "hub.density": None}
PUSHED = {"voltage.law": "constant-thrust", "voltage.value": None, "voltage.thrust": 0.01}
SHEATH = {"solar_wind.thrust_law": "debye-sheath", "solar_wind.cutoff_voltage": None}
SHEATH |= {"solar_wind.electron_temperature_ev": 12.0, "solar_wind.tether_radius": 1e-3}
WINDOW = {"voltage.law": "phase-window", "voltage.on_phase_deg": 0.0, "voltage.off_phase_deg": 180.0}
WINDOW |= {"voltage.rise_phase_deg": 2.0}
LAW_OF = {
    "on_phase_deg": WINDOW, "off_phase_deg": WINDOW, "rise_phase_deg": WINDOW,
    "limit_blend": WAVES | {"voltage.maximum": 3e4},
    "cosine": WAVES, "sine": WAVES, "slew_rate": WAVES, "maximum": WAVES, "law": WAVES, "time": TABLE,
    "table": TABLE, "on": SWITCH, "off": SWITCH, "rise_time": SWITCH, "gain": FEEDBACK,
    "target_sailing_angle_deg": FEEDBACK, "measured_axis": FEEDBACK, "coning_angle_deg": CONE,
    "spin_rate": CONE, "power_limit": {"tethers.wire_radius": 1e-5}, "thrust": PUSHED,
}  # fmt: skip
"""The overrides that a key of [voltage] requires."""


RING = {"tethers.count": 3} | {
    f"auxiliary_tethers.{name}": 1.0 for name in ("length", "area", "density", "youngs_modulus")
}
"""A ring of auxiliary tethers with the keys that it requires."""


ORBIT = {"orbit.position_au": (1.0, 0.0, 0.0), "orbit.velocity": (0.0, 3e4, 0.0)}
ORBIT |= {"initial.heliocentric_position_au": None}
"""An orbit about the Sun; a position in its place must then be absent."""


SPACECRAFT = {
    "hub.height": None, "hub.radius": None, "hub.density": None, "hub.mass": 5.0,
    "hub.centre": (0.1, 0.0, 0.0),
    "hub.torque": (1e-3, 0.0, 0.0),
    "hub.inertia": ((3.0, 0.0, 0.0), (0.0, 4.0, 0.0), (0.0, 0.0, 5.0)),
    "hub.roots": ((0.0, 1.0, 0.0), (0.0, -1.0, 0.0)),
}  # fmt: skip
"""A hub that is no cylinder. The keys of the cylinder are tried without it."""


PAID_OUT = {
    "deployment.start_length": 5e3, "deployment.time": (0.0, 1.0), "deployment.rate": (0.0, 0.125),
}  # fmt: skip


WINCHES = {
    "deployment.start_length": 5e3, "deployment.law": "tension", "deployment.time": (0.0, 2.0),
    "deployment.tension": (0.1, 0.2), "deployment.drum_mass": 3.0,
}  # fmt: skip


def beside(key: str) -> dict:
    """The overrides that a key requires."""
    table, name = key.split(".")
    if table == "event":
        return EVENT
    if SPACECRAFT.get(key) is not None:
        return SPACECRAFT
    if table == "auxiliary_tethers":
        return RING
    if table == "tip_thrust":
        return PULSE
    if table == "orbit":
        return ORBIT
    if name == "reference_distance_au":
        return ORBIT
    if key == "thermal.time":
        return HEAT | {"thermal.temperature": (250.0, 200.0)}
    if table == "thermal":
        return HEAT
    if name == "wires":
        return {"tethers.wire_radius": 1e-5}
    if name in {"thrust_law", "electron_temperature_ev", "tether_radius"}:
        return SHEATH
    if name == "growth":
        return {"deployment.law": "exponential", "deployment.start_length": 5e3}
    if key in ("deployment.tension", "deployment.drum_mass"):
        return WINCHES
    if table == "deployment":
        return PAID_OUT
    if name == "straight_turn":
        return {"tethers.bending_damping_time": 1.0}
    return LAW_OF.get(name, {}) if table == "voltage" else {}


@pytest.fixture(scope="module")
def sail():
    return parse(small_sail.TEXT, "small")


def test_the_sails_of_the_contract_are_built_in():
    sails = {"baseline", "sun-facing", "appendix-d", "voltage-off", "single-tether", "truss"}
    assert sails <= set(builtin_names())


@pytest.mark.parametrize("name", builtin_names())
def test_built_in_scene_loads_and_is_described(name):
    scene = load_scene(name)
    assert scene.members.count >= 1 and scene.integrator.t_end > 0.0
    assert description(name) and not description(name).startswith("#")
    assert "step" not in builtin_text(name), "built-in scenes leave the step to the method"


def test_built_in_scenes_differ_from_the_baseline_as_their_names_say():
    base = load_scene("baseline")
    assert (base.tethers.count, base.tethers.elements, base.initial.sailing_angle_deg) == (12, 5, 10.0)
    assert load_scene("sun-facing").initial.sailing_angle_deg == 0.0
    assert load_scene("appendix-d").initial.sailing_angle_deg == 0.01
    assert load_scene("single-tether").tethers.count == 1
    truss = load_scene("truss").tethers
    assert truss.element == "truss" and not truss.bending
    off = load_scene("voltage-off")
    assert off.voltage is None or off.voltage.value == 0.0


@pytest.mark.parametrize("name", builtin_names())
def test_toml_gives_the_same_built_in_scene_again(name):
    scene = load_scene(name)
    assert parse(to_toml(scene), "again") == scene


def test_toml_keeps_every_digit_and_every_key(sail):
    """Values are numbers without a short decimal form, lists, booleans, strings, and tiny and huge
    numbers."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        scale = 10.0 ** rng.uniform(-300, 300)
        scene = sail.replace(
            {
                "tethers.area": rng.uniform(size=2) * scale,
                "tethers.second_moment": float(np.nextafter(1.0, 2.0)) * 5e-324,
                "tethers.bending": True,
                "tethers.strain": "engineering",
                "remote_units.mass": [0.0, 1.0 / 3.0],
                "voltage.value": -rng.uniform() * scale,
                "gravity.acceleration": rng.normal(size=3),
                "integrator.t_end": rng.uniform() * scale,
                "initial.sailing_angle_deg": 180.0,
            }
        )
        again = parse(to_toml(scene), "again")
        for table in tables_of("sail"):
            assert getattr(again, table) == getattr(scene, table)
        assert to_toml(again) == to_toml(scene)


def test_a_file_a_name_and_a_scene_load_alike(tmp_path, sail):
    small_scene = tmp_path / "small.toml"
    small_scene.write_text(small_sail.TEXT)
    assert load_scene(small_scene) == load_scene(str(small_scene)) == load_scene(sail) == sail
    assert load_scene("truss") == parse(builtin_text("truss"), "truss")


def test_absent_tables_are_absent_parts():
    scene = load_scene("baseline", {"integrator.t_end": 1.0})
    text = "\n\n".join(
        p for p in to_toml(scene).split("\n\n") if not p.startswith(("[hub]", "[remote_units]"))
    )
    scene = parse(text, "without")
    assert scene.hub is None and scene.remote_units is None and scene.gravity is None
    assert "hub" not in to_toml(scene)


def test_defaults_are_those_of_the_contract():
    text = small_sail.TEXT.replace("step = 0.1\n", "").replace("axial_damping_time = 1.0\n", "")
    scene = parse(text, "defaults")
    paper = with_method(scene.replace({"integrator.method": "generalized-alpha"})).integrator
    assert (paper.step, paper.spectral_radius) == (0.1, 0.25)
    table = with_method(scene).integrator
    assert (table.method, table.tolerance, table.step) == ("collocation", 5e-10, None)
    for key, value in (("step", 0.2), ("spectral_radius", 0.5)):
        found = with_method(scene.replace({f"integrator.{key}": value})).integrator
        assert (found.method, getattr(found, key)) == ("generalized-alpha", value)
    assert scene.tethers.strain == "green-lagrange" and scene.tethers.root == "pinned"
    assert scene.tethers.element == "cable" and scene.tethers.bending is False
    assert scene.tethers.axial_damping_time is None


def test_the_tolerance_follows_the_strain_of_stiff_tethers():
    """The default tolerance is 1e-5 (m_u + rho A L / 2) omega^2 L / EA, and at most 5e-10.

    The expected values are computed by hand. A given tolerance is not changed.
    """
    stiff = esail.load_scene("baseline", {"tethers.youngs_modulus": 70e12})
    t, n = stiff.tethers, stiff.initial
    mass = stiff.remote_units.mass + 0.5 * t.density * t.area * t.length
    strain = mass * n.spin_rate**2 * t.length / (70e12 * t.area)
    assert with_method(stiff).integrator.tolerance == pytest.approx(1e-5 * strain, rel=1e-12)
    stiffest = stiff.replace({"tethers.youngs_modulus": [70e12] * 11 + [70e9]})
    assert with_method(stiffest).integrator.tolerance == pytest.approx(1e-5 * strain, rel=1e-12)
    given = stiff.replace({"integrator.tolerance": 1e-6})
    assert with_method(given).integrator.tolerance == 1e-6


@pytest.mark.parametrize("key", SAIL_KEYS)
def test_every_key_can_be_overridden(key, sail):
    """An override changes its key and nothing else."""
    table, name = key.split(".")
    values = {
        "tethers.count": 3, "tethers.elements": 4, "tethers.element": "truss", "tethers.bending": True,
        "tethers.strain": "engineering", "tethers.root": "clamped", "initial.elongation": "paper",
        "integrator.method": "generalized-alpha", "gravity.acceleration": (1.0, 2.0, 3.0),
        "initial.heliocentric_position_au": (0.0, 1.0, 0.5), "initial.coning_angle_deg": 3.0,
        "event.time": (5.0,), "event.release": (2,), "solar_wind.time": (0.0, 1e9),
        "voltage.law": "harmonic", "voltage.cosine": (0.5,), "voltage.sine": (0.5,),
        "voltage.time": (0.0, 1.0), "voltage.table": (0.5, 0.25), "thermal.time": (0.0, 1.0),
        "auxiliary_tethers.element": "cable", "auxiliary_tethers.elements": 2,
        "auxiliary_tethers.strain": "engineering",
        "tethers.wires": 4, "solar_wind.relative": True, "tip_thrust.direction": "radial",
        "solar_wind.thrust_law": "debye-sheath", "voltage.measured_axis": "hub",
        "orbit.position_au": (0.0, 1.0, 0.5), "orbit.velocity": (1e3, 2e4, 0.0),
        "deployment.start_length": 4e3, "deployment.law": "table", "deployment.time": (0.0, 2.0),
        "deployment.rate": (0.0, 0.25), "deployment.growth": 1e-4,
        "deployment.tension": (0.1, 0.2), "deployment.drum_mass": 3.0,
        "initial.epoch": "2027-03-01T12:00:00",
    }  # fmt: skip
    value = values.get(key) or SPACECRAFT.get(key) or 0.125
    extra = {"tethers.second_moment": 2e-18} if key == "tethers.bending" else {}
    extra |= beside(key)
    scene = sail.replace(extra | {key: value})
    assert getattr(getattr(scene, table), name) == value
    for other in tables_of("sail"):
        if other != table and not any(x.startswith(other + ".") for x in extra):
            assert getattr(scene, other) == getattr(sail, other)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"hub.height": None, "hub.radius": None, "hub.density": None}, r"without \[hub\]"),
        (EVENT, r"with \[\[event\]\]"),
    ],
)
def test_feedback_of_the_angular_momentum_needs_a_whole_sail_with_a_hub(overrides, message, sail):
    """Without a hub the sail turns about a fixed centre; a released tether is no part of the sail."""
    asked = FEEDBACK | {"voltage.measured_axis": "angular-momentum"}
    sail.replace(asked)
    with pytest.raises(esail.SceneError, match=f'`voltage.measured_axis` must be "hub" {message}'):
        sail.replace(asked | overrides)


def test_straight_turn_sets_the_curvature_below_which_bending_is_not_damped():
    """kappa_0 = turn / L, with 1e-4 as the default, which does not enter the scene's text."""
    scene = load_scene("baseline")
    assert "straight_turn" not in to_toml(scene)
    for overrides, turn in (({}, 1e-4), ({"tethers.straight_turn": 1e-3}, 1e-3)):
        dissipations = material_terms(*split(scene.replace(overrides))).dissipations
        damping = find_term(dissipations, BendingDissipation)
        assert np.array_equal(damping.straight_curvature, np.full(60, turn / 10e3))


def test_overriding_an_absent_table_makes_it(sail):
    assert sail.gravity is None
    scene = sail.replace({"gravity.acceleration": [0, 0, -9.81]})
    assert scene.gravity.acceleration == (0.0, 0.0, -9.81)


def test_overriding_part_of_an_absent_table_names_what_is_missing(sail):
    bare = dataclasses.replace(sail, hub=None)
    with pytest.raises(esail.SceneError, match=r"`hub\.radius` must be given"):
        bare.replace({"hub.height": 1.0})


def test_overrides_may_give_what_the_file_lacks(tmp_path):
    """`--set` can give a required key that the file lacks, and replace a bad value."""
    path = tmp_path / "part.toml"
    path.write_text(small_sail.TEXT.replace("t_end = 80.0\n", "").replace("[voltage]\nvalue = 20e3", ""))
    scene = load_scene(path, {"integrator.t_end": 7, "voltage.value": 1e3})
    assert scene.integrator.t_end == 7.0 and scene.voltage.value == 1e3
    path.write_text(small_sail.TEXT.replace("count = 2", "count = -2"))
    assert load_scene(path, {"tethers.count": 1}).tethers.count == 1


def test_an_interval_nobody_gave_stays_when_t_end_changes(tmp_path):
    """The default interval does not depend on t_end, so that `--resume --t-end LONGER` continues the same
    scene."""
    path = tmp_path / "no_output.toml"
    path.write_text(small_sail.TEXT.split("[output]")[0])
    assert load_scene(path).output.interval == 0.08
    assert load_scene(path, {"integrator.t_end": 600.0}).output.interval == 0.08


def test_none_takes_a_key_away(sail):
    assert sail.replace({"tethers.axial_damping_time": None}).tethers.axial_damping_time is None


@pytest.mark.parametrize(
    "key",
    ["tethers.length", "tethers.area", "tethers.youngs_modulus", "remote_units.mass", "voltage.value"],
)
def test_physical_numbers_may_be_lists_one_per_tether(key, sail):
    table, name = key.split(".")
    for values in ([1.5, 2.5], np.array([1.5, 2.5]), (1.5, 2.5)):
        assert getattr(getattr(sail.replace({key: values}), table), name) == (1.5, 2.5)
    with pytest.raises(esail.SceneError, match=f"`{key}` must .*2.*`tethers.count`.*but has 3"):
        sail.replace({key: [1.0, 2.0, 3.0]})


@pytest.mark.parametrize("key", STRUCTURE)
def test_a_tracer_is_refused_for_structure_by_name(key, sail):
    def program(x):
        parts = ("event", "auxiliary_tethers", "tip_thrust")
        sail.replace((beside(key) if key.startswith(parts) else {}) | {key: x})
        return x

    with pytest.raises(esail.SceneError, match=f"`{key}` must be a plain Python value"):
        jax.make_jaxpr(program)(1.0)


PLAIN = ("deployment.law", "deployment.time", "initial.epoch")
"""Keys of which no tracer is accepted: the second says where a run is divided, the third is a date."""


@pytest.mark.parametrize("key", [key for key in SAIL_KEYS if key not in (*STRUCTURE, *PLAIN)])
def test_a_tracer_is_accepted_for_every_number(key, sail):
    shapes = {"gravity.acceleration": 3, "initial.heliocentric_position_au": 3, "voltage.cosine": 1}
    shapes |= {"orbit.position_au": 3, "orbit.velocity": 3, "thermal.time": 2}
    shapes |= {
        "deployment.rate": 2,
        "deployment.tension": 2,
        "hub.centre": 3,
        "hub.torque": 3,
        "hub.inertia": (3, 3),
        "hub.roots": (2, 3),
    }
    shapes |= {"voltage.sine": 1, "voltage.time": 2, "voltage.table": 2, "solar_wind.time": 2}
    example = jnp.ones(shapes[key]) if key in shapes else 1.0
    seen = []

    def program(x):
        scene = sail.replace(beside(key) | {key: x})
        seen.append(
            isinstance(getattr(getattr(scene, key.split(".")[0]), key.split(".")[1]), jax.core.Tracer)
        )
        return x

    jax.make_jaxpr(program)(example)
    assert seen == [True]


def test_a_tracer_of_the_wrong_shape_is_refused_by_name(sail):
    with pytest.raises(esail.SceneError, match=r"`hub\.height` must be a single number, but .*\(2,\)"):
        jax.make_jaxpr(lambda x: sail.replace({"hub.height": x}) and x)(jnp.ones(2))


def test_concrete_jax_arrays_are_checked_like_numbers(sail):
    assert sail.replace({"voltage.value": jnp.array([1.0, 2.0])}).voltage.value.tolist() == [1.0, 2.0]
    for key, value in (
        ("hub.height", jnp.array(-1.0)),
        ("integrator.spectral_radius", jnp.array(1.0)),
        ("initial.heliocentric_position_au", jnp.array([0.0, 0.0, 1.0])),
    ):
        with pytest.raises(esail.SceneError, match=f"`{key}` must"):
            sail.replace({key: value})


def test_schedule_numbers_become_plain_floats(sail):
    scene = sail.replace({"integrator.t_end": jnp.array(2.0), "integrator.step": np.float32(0.5)})
    assert type(scene.integrator.t_end) is float and type(scene.integrator.step) is float


def test_simulate_refuses_32_bit(sail):
    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(RuntimeError, match="64-bit"):
            esail.simulate(sail)
        with pytest.raises(RuntimeError, match="64-bit"):
            jax.make_jaxpr(lambda v: esail.simulate(sail, {"voltage.value": v})["time"])(1.0)
    finally:
        jax.config.update("jax_enable_x64", True)


def test_scene_is_checked_however_it_is_made(sail):
    with pytest.raises(esail.SceneError, match=r"`tethers\.count` must be a positive integer"):
        Scene(**{**vars(sail), "tethers": dataclasses.replace(sail.tethers, count=0)})


def test_the_times_of_a_run_are_no_structure():
    """A run to another end, with other saved instants, steps and events, has the programs of the first."""
    scene = load_scene("baseline", {"integrator.method": "generalized-alpha", "integrator.step": 0.1})
    event = {"event.time": [50.0], "event.release": [1]}
    one = split(scene.replace(event))[0]
    times = {"integrator.t_end": 7.0, "integrator.step": 0.2, "output.interval": 1.0}
    assert split(scene.replace(times | {"event.time": [3.0], "event.release": [2]}))[0] == one
    assert split(scene)[0] != one
