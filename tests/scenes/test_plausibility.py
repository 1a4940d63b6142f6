"""Numbers that may be in a wrong unit: a sentence before the run, and in the message of the run."""

import jax
import numpy as np
import pytest

from esail_jax.cli import parser
from esail_jax.commands.command_line import scene_of
from esail_jax.observables.run_warning import run_warning
from esail_jax.scenes.loading import builtin_names, load_scene, read_scene
from esail_jax.scenes.plausibility import USUAL, doubts, without_effect

pytestmark = pytest.mark.usefixtures("nothing_compiles")

WIRES = {"tethers.wire_radius": 12.5e-6}
TABLE = {"voltage.law": "piecewise-linear", "voltage.time": [0.0, 9.0], "voltage.table": [1.0, 0.0]}

DOUBTED = {
    "kilometres": (
        {"tethers.length": 12.0},
        "`tethers.length` is 12 m, where 1e4 m is usual: is it in this unit?",
    ),
    "one of the tethers": ({"tethers.count": 2, "tethers.length": [1e4, 12.0]}, "`tethers.length` is 12 m"),
    "millimetres": ({"tethers.length": 1e7}, "`tethers.length` is 1e+07 m, where"),
    "micrometres": (
        {"tethers.wire_radius": 12.5},
        "`tethers.wire_radius` is 12.5 m, where 1e-5 m is usual",
    ),
    "km/s": ({"solar_wind.speed": 400.0}, "`solar_wind.speed` is 400 m/s, where 4e5 m/s is usual"),
    "1/cm^3": (
        {"solar_wind.number_density": 7.3},
        "`solar_wind.number_density` is 7.3 1/m^3, where 7e6 1/m^3 is usual: is it in this unit?",
    ),
    "kV": (
        {"voltage.value": 20.0},
        "`voltage.value` is 20 V, which is not above `solar_wind.cutoff_voltage`, 1000 V: no tether has",
    ),
    "a fill value of OMNI for the speed": (
        {"solar_wind.speed": 9.999e6},
        "`solar_wind.speed` has 9.999e+06 m/s, which data of OMNI have where",
    ),
    "a fill value of OMNI for the density": (
        {"solar_wind.number_density": 9.999e8},
        "`solar_wind.number_density` has 9.999e+08 1/m^3, which data of OMNI have where",
    ),
    "kilometres from the Sun": (
        {"initial.heliocentric_position_au": [1.5e8, 0.0, 0.0]},
        "`initial.heliocentric_position_au` is 1.5e+08 au from the Sun",
    ),
    "turns per minute": ({"initial.spin_rate": 0.038}, "`initial.spin_rate` is 0.038 rad/s, which strains"),
    "a step longer than the intervals": (
        TABLE | {"integrator.method": "generalized-alpha", "integrator.step": 200.0},
        "`integrator.step` is 200 s, and `voltage.time` has an interval of",
    ),
    "a law of the phase without spin": (
        {"voltage.law": "harmonic", "voltage.sine": [0.1], "initial.spin_rate": -9e-6},
        "`initial.spin_rate` is -9e-06 rad/s: below 1e-05 rad/s the sense of the spin fades, on which",
    ),
    "a window of the phase at rest": (
        {
            "voltage.law": "phase-window",
            "voltage.on_phase_deg": 0.0,
            "voltage.off_phase_deg": 180.0,
            "voltage.rise_phase_deg": 10.0,
            "initial.spin_rate": 0.0,
        },
        "`initial.spin_rate` is 0 rad/s: below",
    ),
    "kV at most": (TABLE | {"voltage.maximum": 30.0}, "`voltage.maximum` is 30 V, which is not above"),
}

PLAUSIBLE = {
    "a slow spin": {"voltage.law": "harmonic", "voltage.sine": [0.1], "initial.spin_rate": -1e-5},
    "rest under another law": {"initial.spin_rate": 0.0},
    "no voltage": {"voltage.value": 0.0},
    "no wind": {"solar_wind.number_density": 0.0},
    "one tether without voltage": {"tethers.count": 2, "voltage.value": [20e3, 0.0]},
    "a low voltage of a table": TABLE | {"voltage.value": 20.0},
    "wires": WIRES,
    "a test in orbit about the Earth": {"tethers.length": 100.0, "solar_wind.number_density": 1e9},
    "a solar storm": {"solar_wind.speed": 2.5e6, "solar_wind.number_density": 1e8},
    "a step shorter than the intervals": TABLE
    | {"integrator.method": "generalized-alpha", "integrator.step": 0.5},
}


@pytest.mark.parametrize("case", DOUBTED)
def test_a_number_in_another_unit_is_doubted(case):
    overrides, sentence = DOUBTED[case]
    (found,) = doubts(load_scene("baseline", overrides))
    assert found.startswith(sentence) and "\n" not in found


@pytest.mark.parametrize("case", PLAUSIBLE)
def test_a_plausible_number_is_not_doubted(case):
    assert doubts(load_scene("baseline", PLAUSIBLE[case])) == ()


def test_built_in_scenes_are_plausible():
    assert not any(doubts(load_scene(name)) for name in builtin_names())
    assert all(limits.least < float(limits.usual.split()[0]) < limits.most for limits in USUAL.values())


def test_a_traced_number_is_not_doubted():
    """It has no value yet."""

    def count(length):
        return len(doubts(load_scene("baseline", {"tethers.length": length})))

    assert jax.eval_shape(lambda x: x + count(x), 12.0).shape == () and count(12.0) == 1


@pytest.mark.parametrize("quiet", [[], ["--quiet"]])
def test_a_command_says_it_before_anything_is_compiled(quiet, capsys):
    settings = ["--set", "tethers.length=12.0", "--set", "voltage.value=20.0"]
    scene_of(parser().parse_args(["run", "baseline", "-o", "a.h5", *settings, *quiet]))
    lines = capsys.readouterr().err.splitlines()
    assert [line.split()[0] for line in lines] == ["`tethers.length`", "`voltage.value`"] * (not quiet)


def test_numbers_of_bending_without_bending_are_said(capsys):
    """The sections of a wire have no effect unless its tether bends, in a sail and in a chain."""
    sail = load_scene("baseline", {"tethers.bending": False})
    (sentence,) = without_effect(sail)
    both = "`tethers.second_moment` and `tethers.bending_damping_time` have no effect"
    assert sentence == f"{both}, because `tethers.bending` is false" and not doubts(sail)
    (sentence,) = without_effect(load_scene("hanging-chain", {"chain.second_moment": 1e-12}))
    assert sentence == "`chain.second_moment` has no effect, because `chain.bending` is false"
    assert not any(without_effect(load_scene(name)) for name in builtin_names())
    scene_of(parser().parse_args(["run", "baseline", "-o", "a.h5", "--set", "tethers.bending=false"]))
    assert capsys.readouterr().err.startswith(both)


def test_the_message_of_a_run_says_it_too():
    """And whether a law kept all tethers without thrust, which is not known before."""
    scene = load_scene("baseline", {"tethers.length": 12.0})
    assert run_warning({}, {}, scene) == doubts(scene)[0]
    swung = read_scene("baseline", {"voltage.law": "python"})
    for most, words in (
        (0.0, "the largest voltage is 0 V (a voltage below zero counts as zero), which is not above"),
        (20.0, "No tether has thrust at a saved instant: the largest voltage is 20 V"),
    ):
        assert words in run_warning({"voltage": np.array([[0.0, most], [np.nan, 0.0]])}, {}, swung)
    assert run_warning({"voltage": np.array([[0.0], [20e3]])}, {}, swung) == ""
    pulse = {"voltage.law": "on-off", "voltage.on": 1.0, "voltage.off": 2.0, "voltage.rise_time": 0.1}
    pulsed = read_scene("baseline", pulse)
    assert run_warning({"voltage": np.zeros((2, 1))}, {}, pulsed) == ""  # on between two saved instants
    assert run_warning({}, {}, swung) == run_warning({}, {}, load_scene("hanging-chain")) == ""
