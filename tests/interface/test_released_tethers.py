"""What figures show of a released tether, and what `esail plot` says of it."""

import io

import numpy as np
import pytest
from matplotlib.figure import Figure

import esail_jax
from esail_jax import plotting
from esail_jax.commands import plot
from esail_jax.plotting.figure_files import write_figures
from esail_jax.scenes.tethers import Event
from support.fake_run import PERIOD, TIME, make_run, scene_of
from support.figures import panels


class Terminal(io.StringIO):
    """A text stream that claims to be a terminal."""

    def isatty(self):
        return True


def names_in_legend(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_releases_are_marked_in_every_plot_against_time():
    """A line at each instant, and one entry of the legend that names the tethers."""
    run = make_run(scene_of(event=Event(time=[700.0, 300.0], release=[2, 3])))
    for make in (plotting.tether_motion, plotting.energies, plotting.attitude, plotting.voltages):
        for label, ax in panels(make(run)).items():
            if "PSD" in label or ax.get_label() == "<colorbar>":
                continue
            marked = [line.get_xdata()[0] for line in ax.lines[-2:]]
            assert marked == pytest.approx([300.0 / PERIOD, 700.0 / PERIOD]), label
            assert names_in_legend(ax)[-1] == "tethers 2, 3 released", label
    ax = esail_jax.plot(run, "kinetic_energy", ax=Figure().add_subplot())
    assert len(ax.lines) == 3 and names_in_legend(ax) == ["tethers 2, 3 released"]
    run = make_run(scene_of(5, event=Event(time=[3.0, 4.0, 5.0, 6.0], release=[1, 2, 3, 4])))
    ax = esail_jax.plot(run, "kinetic_energy", ax=Figure().add_subplot())
    assert names_in_legend(ax) == ["4 tethers released"]


def lines_of_tethers(run):
    """The points (tether, point, 3) [km] of the tethers, the grey lines, in the last picture of a
    sail."""
    lines = plotting.picture.sail_picture(run).axes[-1].lines
    return np.array([x.get_data_3d() for x in lines if isinstance(x.get_color(), str)][:3]).swapaxes(1, 2)


def test_a_released_tether_is_not_drawn_from_the_hub_to_its_tip():
    """Without the positions of the nodes only the tip of a released tether is known."""
    run = make_run(scene_of(event=Event(time=[700.0], release=[2])))
    lines = lines_of_tethers(run)
    assert np.isnan(lines[1]).all()
    assert np.allclose(lines[[0, 2], 1], run["tip_position_I"][-1, [0, 2]] / 1e3, rtol=0, atol=1e-12)


def test_tethers_are_drawn_through_their_nodes():
    """The nodes show where a released tether is, too."""
    run = make_run(scene_of(event=Event(time=[700.0], release=[2])))
    run.data["node_position_I"] = np.random.default_rng(1).normal(size=(len(TIME), 3, 4, 3))
    assert np.allclose(lines_of_tethers(run), run["node_position_I"][-1] / 1e3, rtol=0, atol=1e-12)


def test_modes_that_cannot_be_drawn_are_said(capsys):
    """A sail that loses a tether has no modes: one line says why the spectra lack their lines."""
    assert plot.modes_of(make_run(scene_of(event=Event(time=[700.0], release=[2])))) is None
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith(
        "The spectra of tether_motion.png have no lines of modes: `event` must be left out"
    )


def test_a_figure_is_told_as_soon_as_it_is_written(tmp_path, capsys):
    """`esail plot` prints a path when the file is there, before the next figure is made."""
    seen = []

    def figures():
        for name in ("first", "second"):
            seen.append((capsys.readouterr().out, sorted(path.name for path in tmp_path.iterdir())))
            yield name, Figure()

    paths = write_figures(figures(), tmp_path, plot.tell)
    assert seen == [("", []), (f"{paths[0]}\n", ["first.png"])]
    assert capsys.readouterr().out == f"{paths[1]}\n"


def test_a_terminal_shows_that_modes_are_computed(monkeypatch):
    """The line is there while they are computed, and gone before paths are printed."""
    stream, shown = Terminal(), []
    monkeypatch.setattr("sys.stderr", stream)
    monkeypatch.setattr(
        "esail_jax.modal.sail_modes.modes", lambda *_, **__: shown.append(stream.getvalue())
    )
    plot.modes_of(make_run(scene_of()))
    assert shown == ["\rComputing the modes of the sail, for the lines in its spectra\x1b[K"]
    assert stream.getvalue() == shown[0] + "\r\x1b[K"
