"""Figures of synthetic runs of a sail, and the function `plot`."""

import dataclasses
import subprocess
import sys
from types import SimpleNamespace

import matplotlib.image
import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.figure import Figure
from matplotlib.mathtext import MathTextParser
from PIL import Image

import esail_jax
from esail_jax import plotting
from esail_jax.observables import chain, sail
from esail_jax.observables.rigid_pendulum import rigid_pendulum
from esail_jax.plotting.figure_files import DOTS_PER_INCH, write_figures
from esail_jax.plotting.single import mathtext
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.tethers import RemoteUnits
from support.fake_run import PERIOD, TIME, FakeRun, make_run, scene_of
from support.figures import check_axes, panels


def no_spin():
    initial = dataclasses.replace(load_scene("baseline").initial, spin_rate=0.0)
    run = make_run(scene_of(initial=initial))
    for name in run.data:
        if "thrust" in name or "external" in name:
            run.data[name] = 0.0 * run.data[name]
    return run


def failed_at(index):
    run = make_run(scene_of())
    for name, values in run.data.items():
        run.data[name] = values.copy()
        run.data[name][index:] = np.nan
    return run


def start_only():
    run = make_run(scene_of())
    return FakeRun(run.scene, TIME[:1], {name: values[:1] for name, values in run.data.items()})


def different_tethers():
    scene = scene_of(remote_units=RemoteUnits(mass=(1.0, 2.0, 0.0)))
    tethers = dataclasses.replace(scene.tethers, length=(9e3, 10e3, 11e3))
    return make_run(dataclasses.replace(scene, tethers=tethers))


RUNS = {
    "full": different_tethers,
    "no hub": lambda: make_run(scene_of(hub=None)),
    "one tether": lambda: make_run(scene_of(1, hub=None, remote_units=None)),
    "no spin, no wind": no_spin,
    "failed": lambda: failed_at(30),
    "start only": start_only,
}


@pytest.fixture(scope="module")
def runs():
    return {name: make() for name, make in RUNS.items()}


FIGURES = [make for make in plotting.FIGURES if make is not plotting.deployment]
"""The figures of tethers of constant length."""


def test_the_figure_of_a_deployment(runs):
    """Lengths, rates, lag, and tensions and powers of the winches of every tether, and their work."""
    run, rng = different_tethers(), np.random.default_rng(3)
    assert not plotting.deployment(run).axes
    names = ("deployed_length", "payout_rate", "winch_tension", "winch_power")
    run.data |= {name: rng.normal(size=(len(TIME), 3)) for name in names}
    run.data["winch_work"] = rng.normal(size=len(TIME))
    figure = plotting.deployment(run)
    assert len(panels(figure)) == 6 + 1  # and the key of the colours
    check_axes(figure)
    assert r"$\Delta E_T - W_{ext} + E_d - W_w$ [J]" in panels(plotting.energies(run))


@pytest.mark.parametrize("make", FIGURES, ids=lambda make: make.__name__)
@pytest.mark.parametrize("name", RUNS)
def test_every_axis_says_what_it_shows(runs, make, name):
    figure = make(runs[name])
    assert figure.axes
    check_axes(figure)


def table_of(*modes):
    """An object that replaces a table of modes: (eigenvalue, kind, nodes, name) of each."""
    values, kind, nodes, name = zip(*modes, strict=True)
    return SimpleNamespace(eigenvalue=np.array(values), kind=kind, nodes=nodes, name=name)


def test_spectra_mark_the_modes_of_their_signal(runs):
    """A vibration exp(s t) rings at Im s / (2 pi): there is its line, in the spectra of the signal that it
    moves. Overdamped motions, high orders and what lies outside the spectrum have no line."""
    ringing = 2.0 * np.pi * 4e-3
    table = table_of(
        (-1e-3 + 1j * ringing, "out-of-plane", 1, "first out-of-plane bending, collective"),
        (-1e-3 + 1j * ringing, "out-of-plane", 1, "first out-of-plane bending, n = 1 around the circle"),
        (-0.1 + 0j, "axial", 0, "first axial (stretching), overdamped"),
        (1j * ringing, "in-plane", 5, "fifth in-plane bending"),
        (200.0j, "in-plane", 0, "in-plane swing (lagging)"),
        (4e-3j, "out-of-plane", 0, "spin-axis precession (tilt of the whole sail)"),
    )
    with_modes = panels(plotting.tether_motion(runs["full"], modes=table))
    without = panels(plotting.tether_motion(runs["full"]))
    for label, ax in with_modes.items():
        added = ax.lines[len(without[label].lines) :]
        assert [line.get_xdata()[0] for line in added] == pytest.approx(
            [4e-3, 4e-3] if "PSD" in label and "gamma" in label else []
        )
        assert not ax.texts, "nothing is written over curves"
        if "PSD" in label:
            assert names_in_legend(ax) == ["spin"] + ["first out-of-plane bending"] * bool(added)


def test_tether_motion_shows_the_chosen_tether_in_degrees_and_spin_periods(runs):
    run = runs["full"]
    shown = panels(plotting.tether_motion(run, tether=1))
    assert len(shown) == 10
    time, angle = shown[r"$\gamma_{2}$ [deg]"].lines[0].get_data()
    np.testing.assert_allclose(time, TIME * 4e-3 / (2.0 * np.pi))
    np.testing.assert_allclose(angle, np.degrees(run["coning_angle"][:, 1]))
    rigid = shown[r"$\beta_{2}$ [deg]"].lines[1].get_data()
    np.testing.assert_allclose(rigid[1], np.degrees(rigid_pendulum(run, 1)[2]))
    dashed = shown[r"PSD of $\gamma_{2}$ [deg$^2$/Hz]"].lines[1].get_xdata()
    np.testing.assert_allclose(dashed, 1.0 / PERIOD)


def test_length_is_divided_by_that_of_the_tether(runs):
    run = runs["full"]
    shown = panels(plotting.tether_motion(run, tether=2))["$L/L_0$ [-]"].lines[0].get_ydata()
    np.testing.assert_allclose(shown, run["tether_length"][:, 2] / 11e3)


def test_without_spin_time_is_in_seconds_and_nothing_rigid_turns(runs):
    figure = plotting.tether_motion(runs["no spin, no wind"])
    ax = panels(figure)[r"$\gamma_{1}$ [deg]"]
    assert len(ax.lines) == 1
    np.testing.assert_allclose(ax.lines[0].get_xdata(), TIME)


def test_absent_data_leaves_no_panel(runs):
    assert len(plotting.attitude(runs["full"]).axes) == 8
    assert len(plotting.attitude(runs["no hub"]).axes) == 5
    assert len(plotting.attitude(runs["one tether"]).axes) == 1
    assert len(plotting.tether_motion(runs["start only"]).axes) == 5
    assert r"$d_{min}$ [km]" not in panels(plotting.all_tethers(runs["one tether"]))


def test_voltages_are_shown_if_there_is_something_to_see(runs):
    """One line per tether in kV, and the power; no figure of one voltage that all tethers keep."""
    run = runs["full"]
    shown = panels(plotting.voltages(run))
    assert set(shown) == {"$V_i$ [kV]", "$P_{el}$ [W]", "tether $i$ [-]"}
    for line, volts in zip(shown["$V_i$ [kV]"].lines, run["voltage"].T, strict=True):
        np.testing.assert_allclose(line.get_ydata(), 1e-3 * volts)
    without = {name: x for name, x in run.data.items() if name != "electric_power"}
    own = np.tile([20e3, 10e3, 0.0], (len(TIME), 1))
    for volts, wanted in ((run["voltage"], 2), (own, 2), (np.full_like(own, 20e3), 0), (0.0 * own, 0)):
        found = plotting.voltages(FakeRun(run.scene, TIME, without | {"voltage": volts}))
        assert len(found.axes) == wanted
    still = FakeRun(run.scene, TIME, run.data | {"voltage": np.full_like(own, 20e3)})
    assert len(plotting.voltages(still).axes) == 3


def test_energies_start_at_zero_and_euler_angles_do_not_jump(runs):
    run = runs["full"]
    total = panels(plotting.energies(run))["$E_T - E_T(0)$ [J]"].lines[0].get_ydata()
    energy = run["kinetic_energy"] + run["elastic_energy"]
    np.testing.assert_allclose(total, energy - energy[0], atol=1e-12)
    turning = np.stack([TIME * 4e-3] * 3, axis=1)
    wrapped = np.angle(np.exp(1j * turning))
    turned = FakeRun(run.scene, TIME, run.data | {"euler_hub": wrapped})
    phi = panels(plotting.attitude(turned))[r"$\phi$ [deg]"].lines[0].get_ydata()
    np.testing.assert_allclose(phi, np.degrees(turning[:, 2]))


def test_frequencies_are_labelled_once_below_each_column(runs):
    """At powers of ten if there is one, and below the lowest panel only: the labels of numbers between
    powers of ten covered each other, and stood below every panel."""
    whole = runs["full"]
    short = FakeRun(whole.scene, TIME[:31], {name: values[:31] for name, values in whole.data.items()})
    figure = plotting.tether_motion(short)
    spectra = [ax for ax in figure.axes if ax.get_xscale() == "log"]
    figure.draw_without_rendering()
    for ax in spectra:
        shown = [text.get_text() for text in ax.get_xticklabels(which="minor") if text.get_visible()]
        assert not any(shown)
    low, high = spectra[-1].get_xlim()
    assert 1e-3 < low < 1e-2 < high < 1e-1
    labels = [[text.get_text() for text in ax.get_xticklabels() if text.get_text()] for ax in spectra]
    assert labels[-1] and not any(labels[:-1])


def test_a_written_figure_is_that_of_matplotlib(runs, tmp_path):
    """It is drawn once, where `savefig` draws it twice: the pixels and the resolution are the same."""
    write_figures([("once", plotting.energies(runs["one tether"]))], tmp_path)
    plotting.energies(runs["one tether"]).savefig(tmp_path / "twice.png", dpi=DOTS_PER_INCH)
    once, twice = (Image.open(tmp_path / f"{name}.png") for name in ("once", "twice"))
    assert np.array_equal(np.asarray(once), np.asarray(twice))
    assert once.info["dpi"] == twice.info["dpi"]


@pytest.mark.nightly
def test_plot_all_writes_png_files(runs, tmp_path, monkeypatch):
    monkeypatch.setattr(plotting.figure_files, "DOTS_PER_INCH", 20)
    told = []
    paths = plotting.plot_all(runs["one tether"], tmp_path / "new" / "figures", tell=told.append)
    assert told == paths
    assert [path.name for path in paths] == [f"{make.__name__}.png" for make in FIGURES]
    for path in paths:
        assert matplotlib.image.imread(path).std() > 0.0


def test_nothing_is_written_without_data(tmp_path):
    assert plotting.plot_all(failed_at(0), tmp_path) == []


def test_plot_draws_one_observable_with_its_unit_and_symbol(runs):
    """Into the axes that it is given, one coloured line per tether."""
    run, given = runs["full"], Figure().add_subplot()
    ax = esail_jax.plot(run, "coning_angle", ax=given)
    assert ax is given
    assert (ax.get_xlabel(), ax.get_ylabel()) == (r"time $t/T_s$ [-]", r"coning angle, $\gamma$ [rad]")
    for line, values in zip(ax.lines, run["coning_angle"].T, strict=True):
        np.testing.assert_allclose(line.get_xdata(), TIME / PERIOD)
        np.testing.assert_array_equal(line.get_ydata(), values)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["tether 1", "tether 2", "tether 3"]


def test_plot_makes_axes_if_it_is_given_none(runs):
    ax = esail_jax.plot(runs["full"], "kinetic_energy")
    assert len(ax.lines) == 1 and ax.get_legend() is None
    pyplot.close(ax.figure)


def names_in_legend(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_components_of_vectors_and_angles_are_named(runs):
    run, ax = runs["full"], Figure().add_subplot()
    assert names_in_legend(esail_jax.plot(run, "thrust_O", ax=ax)) == ["x", "y", "z"]
    assert ax.get_ylabel() == "thrust in O, $F_{c}$ [N]"
    angles = esail_jax.plot(run, "euler_hub", ax=Figure().add_subplot())
    assert names_in_legend(angles) == [r"$\psi$", r"$\theta$", r"$\phi$"]
    tips = esail_jax.plot(run, "tip_position_I", ax=Figure().add_subplot())
    assert names_in_legend(tips) == ["tether 1", "tether 2", "tether 3", "x", "y", "z"]
    np.testing.assert_array_equal(tips.lines[5].get_ydata(), run["tip_position_I"][:, 1, 2])
    assert tips.lines[5].get_linestyle() == ":"


@pytest.mark.parametrize(
    "entry", [*sail.OBSERVABLES, *chain.OBSERVABLES, chain.ENERGY_ERROR], ids=lambda x: x.name
)
def test_symbol_of_every_observable_can_be_typeset(entry):
    MathTextParser("path").parse(mathtext(entry.symbol))


def test_symbols_are_typeset_with_greek_letters_and_whole_indices():
    found = [
        mathtext(x)
        for x in ("F_lambda", "eps_max", "omega^B", "F_c,i", "dE - W + E_d", "psi, theta, phi", "beta'")
    ]
    assert found == [
        r"$F_{\lambda}$", r"$\epsilon_{max}$", r"$\omega^{B}$", "$F_{c,i}$", "$dE - W + E_{d}$",
        r"$\psi, \theta, \phi$", r"$\beta'$",
    ]  # fmt: skip


def test_plot_without_a_name_makes_the_overview(runs):
    """The figures that `esail plot` writes; without a hub the attitude is still there."""
    figures = esail_jax.plot(runs["no hub"])
    assert list(figures) == [make.__name__ for make in FIGURES]
    assert esail_jax.plot(failed_at(0)) == {}


def test_plot_refuses_what_it_cannot_draw(runs):
    run = runs["no hub"]
    must = "`name` must be an observable of the run"
    for name, hint in (
        ("euler_hub", r"'euler_hub' \(only with \[hub\]\)"),
        ("electron_current", r"'electron_current' \(only with `tethers.wire_radius`\)"),
        ("voltages", r"'voltages' \(perhaps `voltage`\)"),
        ("power", r"'power' \(perhaps `dissipated_power`, `external_power` or `electric_power`\)"),
    ):
        with pytest.raises(ValueError, match=f"{must}, but is {hint}"):
            esail_jax.plot(run, name)
    with pytest.raises(ValueError, match=must + r" \(coning_angle, .*\), but is 'xyz'"):
        esail_jax.plot(run, "xyz")
    with pytest.raises(ValueError, match=r"`name` must be given with `ax`, but is None"):
        esail_jax.plot(run, ax=Figure().add_subplot())
    with pytest.raises(ValueError, match=r"`solution` must have a scene, but was computed under a trace"):
        esail_jax.plot(FakeRun(None, run.time, run.data), "voltage")


def test_the_package_does_not_import_matplotlib_by_itself():
    program = "import sys, esail_jax; assert 'matplotlib' not in sys.modules; esail_jax.plot"
    subprocess.run([sys.executable, "-c", program], check=True)
    with pytest.raises(AttributeError, match="no attribute 'plots'"):
        esail_jax.plots  # noqa: B018
