"""`esail plot` of one figure: some observables of a run, in a file of a kind, against time or dates."""

import re

import matplotlib.dates
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.cli import main
from esail_jax.plotting import plot
from esail_jax.plotting.dates import Calendar, Ticks
from esail_jax.plotting.panels import time_unit
from esail_jax.plotting.single import draw_together

EPOCH = "2027-03-01T12:00:00"
STARTS = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}


@pytest.fixture(scope="module")
def dated(solution):
    return esail.simulate(solution.scene, {"initial.epoch": EPOCH})


@pytest.mark.parametrize("kind", STARTS)
def test_a_figure_is_of_the_kind_of_its_ending(kind, whole, tmp_path, capsys):
    """And has the same bytes every time: no date of its making."""
    paths = [tmp_path / f"{name}.{kind}" for name in "ab"]
    for path in paths:
        assert main(["plot", str(whole), "-o", str(path), "--observables", "coning_angle"]) == 0
    assert capsys.readouterr().out == "".join(f"{path}\n" for path in paths)
    contents = [path.read_bytes() for path in paths]
    assert contents[0].startswith(STARTS[kind])
    if kind != "svg":  # its parts have random names
        assert contents[0] == contents[1]


def test_panels_are_in_the_order_of_the_names(solution):
    """They share the time axis, which the lowest one labels."""
    figure = draw_together(solution, ["voltage", "kinetic_energy"])
    first, second = figure.axes
    assert first.get_ylabel().startswith("voltage") and second.get_ylabel().startswith("kinetic energy")
    assert not first.get_xlabel() and second.get_xlabel().startswith("time")


def test_what_was_saved_on_request_is_drawn_too(solution):
    """Positions of all nodes have three axes after time: too many for lines."""
    run = esail.simulate(solution.scene, save=["hub_acceleration_B", "node_position_I"])
    ax = draw_together(run, ["hub_acceleration_B"]).axes[0]
    drawn = np.array([line.get_ydata() for line in ax.lines]).T
    assert np.array_equal(drawn, run["hub_acceleration_B"]) and "hub acceleration" in ax.get_ylabel()
    with pytest.raises(ValueError, match=r"two axes after time, but node_position_I has 3 \(tether, node"):
        draw_together(run, ["node_position_I"])


def test_dates_are_those_of_the_run(dated, solution):
    """In days of matplotlib; a run without an epoch has none."""
    ax = plot(dated, "kinetic_energy", calendar=True)
    assert ax.get_xlabel() == "date [UTC]"
    days = ax.lines[0].get_xdata()
    expected = matplotlib.dates.date2num(np.array(dated.dates(6), "datetime64[us]"))
    assert np.abs(days - expected).max() < 1e-9
    for name in ("kinetic_energy", None):
        with pytest.raises(ValueError, match=r"`calendar` must be left out for a run without"):
            plot(solution, name, calendar=True)


def test_all_figures_may_have_dates(dated):
    """The curves stay where they are; the ticks of the axes of time stand at round dates, those of a
    spectrum do not."""
    plain, shown = plot(dated), plot(dated, calendar=True)
    zero = matplotlib.dates.date2num(np.datetime64(dated.dates(6)[0]))
    unit, label = time_unit(dated)
    assert list(plain) == list(shown)
    seen = 0
    for name, figure in shown.items():
        for ax, other in zip(figure.axes, plain[name].axes, strict=True):
            for line, same in zip(ax.lines, other.lines, strict=True):
                assert np.array_equal(line.get_xdata(), same.get_xdata())
            assert (ax.get_xlabel() == "date [UTC]") == (other.get_xlabel() == label)
            if ax.get_xlabel() != "date [UTC]":
                continue
            seen += 1
            ticks = zero + np.asarray(ax.xaxis.get_majorticklocs()) * unit / 86400.0
            assert np.abs(ticks * 86400.0 - np.round(ticks * 86400.0)).max() < 1e-4  # whole seconds
            texts = [text for text in ax.xaxis.get_major_formatter().format_ticks(ax.get_xticks()) if text]
            assert all(
                re.fullmatch(r"\d\d:\d\d(:\d\d)?|\d\d(\.\d)?|[A-Z][a-z]{2}-\d\d", text) for text in texts
            )
            assert len(texts) >= 2
    assert seen > 3


@pytest.mark.parametrize("length", [220.0, 1.5e4, 4.0 * 86400.0, 1.4e8])
def test_axes_of_any_length_have_few_dates(length):
    """Nothing is warned of (warnings are errors here), and 3 to 8 ticks lie on the axis."""
    ticks = Ticks(Calendar.of(EPOCH, 1.0)).tick_values(0.0, length)
    assert 3 <= ((ticks >= 0.0) & (ticks <= length)).sum() <= 8


def test_a_folder_has_files_of_the_kind_that_is_asked_for(whole, tmp_path):
    assert main(["plot", str(whole), "-o", str(tmp_path / "all"), "--format", "pdf"]) == 0
    files = list((tmp_path / "all").iterdir())
    assert len(files) > 3 and all(path.read_bytes().startswith(b"%PDF") for path in files)


REFUSED = {
    "no names": (["-o", "a.pdf"], "`--observables` must be given with the file"),
    "two kinds": (
        ["-o", "a.pdf", "--observables", "voltage", "--format", "svg"],
        "`--format` must be left",
    ),
    "folder": (
        ["-o", "folder", "--observables", "voltage"],
        "`--observables` must be left out unless `-o`",
    ),
    "dates": (["-o", "folder", "--calendar"], "`--calendar` must be left out for a run without"),
    "unknown": (
        ["-o", "a.svg", "--observables", "coning"],
        "`--observables` must be an observable of the run",
    ),
    "no epoch": (
        ["-o", "a.svg", "--observables", "voltage", "--calendar"],
        "`--calendar` must be left out for a run without `initial.epoch`, but is given",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused(name, whole, tmp_path, capsys, monkeypatch):
    """In one line, and nothing is written."""
    monkeypatch.chdir(tmp_path)
    options, message = REFUSED[name]
    assert main(["plot", str(whole), *options]) == 2
    error = capsys.readouterr().err
    assert error.startswith(message) and error.count("\n") == 1 and not list(tmp_path.iterdir())


def test_a_figure_is_replaced_only_if_asked(whole, tmp_path, capsys):
    path = tmp_path / "a.png"
    path.write_text("mine")
    options = ["plot", str(whole), "-o", str(path), "--observables", "voltage"]
    assert main(options) == 2 and path.read_text() == "mine"
    assert "must not exist (or ask for --overwrite)" in capsys.readouterr().err
    assert main([*options, "--overwrite"]) == 0 and path.read_bytes().startswith(STARTS["png"])
