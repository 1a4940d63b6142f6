"""Figures that compare several runs, drawn from synthetic runs, and the keys in which scenes differ."""

import dataclasses

import numpy as np
import pytest

from esail_jax.errors import InputError
from esail_jax.plotting import compare
from esail_jax.scenes.key_reference import differing_keys
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.tethers import Event
from support.fake_run import PERIOD, FakeRun, make_run, scene_of
from support.figures import check_axes, panels


def sail(**initial):
    scene = load_scene("baseline")
    return make_run(scene_of(initial=dataclasses.replace(scene.initial, **initial)))


def chain(**changes):
    """A run of a chain of three rods whose joints move along x."""
    scene = load_scene("hanging-chain", {"chain.rods": 3} | {f"chain.{k}": v for k, v in changes.items()})
    times = np.linspace(0.0, 1.0, 11)
    names = ("kinetic_energy", "elastic_energy", "potential_energy", "energy_error")
    data = {name: np.sin(times) for name in names} | {"tension": np.outer(times, [3.0, 2.0, 1.0])}
    joints = np.zeros((11, 4, 3))
    joints[:, -1, 0], joints[:, 0, 0] = 7.0 * times, 2.0 * times
    return FakeRun(scene, times, data | {"joint_position": joints})


def legend_of(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


@pytest.mark.parametrize("make", [sail, chain])
def test_every_panel_has_a_line_of_every_run(make):
    figures = compare({"a": make(), "b": make(), "c": make()})
    assert len(figures) == (3 if make is sail else 2)
    for figure in figures.values():
        check_axes(figure)
        assert all(len(ax.lines) == 3 for ax in figure.axes)
        assert all(ax.get_xlabel() in ("", "time $t/T_s$ [-]", "time $t$ [s]") for ax in figure.axes)
        assert legend_of(figure) == ["a", "b", "c"]


def test_the_tip_is_drawn_relative_to_the_first_joint():
    """The tip moves by 7 t, the first joint by 2 t."""
    ax = panels(compare({"a": chain(), "b": chain()})["compare_tip"])["$x_{tip}$ [m]"]
    assert np.allclose(ax.lines[1].get_ydata(), 5.0 * np.linspace(0.0, 1.0, 11), rtol=1e-14)


def test_errors_are_drawn_as_their_largest_value_so_far():
    run = chain()
    run.data["energy_error"] = np.array([0.0, 1, -3, 2, 0, -1, 4, 0, 0, 5, 0]) * 1e-9
    ax = panels(compare({"a": run, "b": run})["compare_chain_energies"])[r"$\max|e_E|$ [-]"]
    assert np.array_equal(ax.lines[0].get_ydata(), np.array([0, 1, 3, 3, 3, 3, 4, 4, 4, 5, 5]) * 1e-9)
    assert ax.get_yscale() == "log"


def test_what_a_run_lacks_is_left_out():
    """A panel has the lines of the runs that have its observable, and none has no panel."""
    full, less = sail(), sail()
    for run, name in ((less, "sailing_angle"), (less, "precession_angle"), (full, "precession_angle")):
        del run.data[name]
    shown = panels(compare({"full": full, "less": less})["compare_sail"])
    assert len(shown[r"$\alpha$ [deg]"].lines) == 1 and r"$\delta$ [deg]" not in shown


def test_runs_that_spin_differently_are_drawn_against_seconds():
    figure = compare({"slow": sail(spin_rate=3e-3), "fast": sail()})["compare_tether"]
    assert {ax.get_xlabel() for ax in figure.axes} <= {"", "time $t$ [s]"}
    assert legend_of(figure) == ["slow: initial.spin_rate = 0.003", "fast: initial.spin_rate = 0.004"]


def test_the_legend_has_names_alone_if_many_keys_differ():
    scene = load_scene("truss")
    other = dataclasses.replace(sail(), scene=scene)
    assert len(differing_keys([sail().scene, scene])) > 2
    assert legend_of(compare({"a": sail(), "b": other})["compare_sail"]) == ["a", "b"]


def test_a_sail_is_not_compared_with_a_chain():
    with pytest.raises(InputError, match=r"^`b` must be of a sail like `a`, but is of a rod chain$"):
        compare({"a": sail(), "b": chain()})
    with pytest.raises(InputError, match=r"^`runs` must have at least one run, but is empty$"):
        compare({})


def test_keys_in_which_scenes_differ():
    """Equal keys are left out, absent ones are dashes, and long lists are cut."""
    first = load_scene("baseline")
    assert differing_keys([first, first]) == {}
    second = first.replace(
        {"voltage": None, "solar_wind": None, "tethers.length": tuple(1e4 + np.arange(12.0))}
    )
    found = differing_keys([first, second, first])
    assert set(found) == {"tethers.length"} | {
        f"{table}.{name}"
        for table in ("voltage", "solar_wind")
        for name, value in vars(getattr(first, table)).items()
        if value is not None
    }
    assert found["voltage.value"] == ("20000", "-", "20000")
    assert found["tethers.length"][0] == "10000" and len(found["tethers.length"][1]) <= 60
    assert found["tethers.length"][1].startswith("10000, 10001, 10002, ")
    other = {
        "event.time": [1000.0],
        "event.release": [2],
        "voltage.value": 15.5e3,
        "tethers.strain": "engineering",
    }
    found = differing_keys([first, first.replace(other)])
    assert found["event.time"] == ("-", "1000") and found["event.release"] == ("-", "2")
    assert found["voltage.value"] == ("20000", "15500") and found["tethers.strain"][1] == "engineering"
    assert differing_keys(
        [first, first.replace(other | {"event.time": [1e3, 2e3], "event.release": [2, 3]})]
    )["event.time"] == ("-", "1000, 2000")


def test_releases_are_marked_once_or_for_every_run():
    """Equal instants are one line in every panel and one entry of the legend; other ones have the colour
    and the name of their run. What happens after the end of a run is not marked."""
    early, late, never = (released_at(t) for t in (400.0, 800.0, 1e6))
    figure = compare({"a": early, "b": early})["compare_sail"]
    assert legend_of(figure) == ["a", "b", "tether 2 released"]
    assert all(len(ax.lines) == 3 for ax in figure.axes)
    assert figure.axes[0].lines[2].get_xdata()[0] == pytest.approx(400.0 / PERIOD)
    figure = compare({"a": early, "b": late, "c": never})["compare_sail"]
    assert legend_of(figure)[3:] == ["a: tether 2 released", "b: tether 2 released"]
    first, second = figure.axes[0].lines[3:]
    assert second.get_xdata()[0] == pytest.approx(800.0 / PERIOD)
    assert np.array_equal(first.get_color(), figure.axes[0].lines[0].get_color())


def released_at(time):
    return make_run(scene_of(event=Event(time=[time], release=[2])))
