"""Tests of what the commands share: progress bar, interruption, exit codes, atomic files."""

import io
import os
import signal

import h5py
import numpy as np
import pytest

from esail_jax import cli
from esail_jax.atomic_file import atomic_file
from esail_jax.commands import progress
from esail_jax.commands.command_line import ExitCode
from esail_jax.commands.progress import Progress, RunProgress
from esail_jax.commands.reports import release_text
from esail_jax.files.hdf5 import atomic_hdf5
from esail_jax.interrupts import Interrupts
from esail_jax.scenes.loading import builtin_names, load_scene
from esail_jax.simulation.results import Chunk


class Terminal(io.StringIO):
    """A text stream that claims to be a terminal."""

    def isatty(self):
        return True


def test_progress_bar(monkeypatch):
    """The clock starts at the first report. Reports that follow too fast are not drawn, except the last
    one."""
    now = [0.0]
    monkeypatch.setattr(progress.time, "perf_counter", lambda: now[0])
    stream = Terminal()
    monkeypatch.setattr("sys.stderr", stream)
    shown = Progress(100.0, lambda done, speed: [f"{done:g} at {speed:g}"])
    shown.stage("compiling the program of the start ...")
    assert stream.getvalue() == "\rcompiling the program of the start ...\x1b[K"
    for now[0], done in ((50.0, 20.0), (50.01, 21.0), (52.0, 60.0), (52.01, 100.0)):
        shown.update(done)
    shown.close()
    shown.update(100.0)
    lines = stream.getvalue().removesuffix("\n").split("\r")
    texts = [line.removesuffix(" \x1b[K") for line in lines][1:]
    assert texts[1] == "[####................]  20 %  20 at 0  -:-- left"
    assert texts[2] == "[############........]  60 %  60 at 20  00:02 left"
    assert texts[3].startswith(f"[{'#' * 20}] 100 %  100 at ") and len(texts) == 4


def test_line_of_a_run_fits_the_terminal(monkeypatch):
    """It tells time, speed, last step, iterations and energy error; the last ones are left out on a
    narrow terminal. A chain has no iterations, and its energy error is relative."""
    chunk = Chunk(
        np.array([5.0]),
        {"energy_balance_error": np.array([-3e-7])},
        {"last_step": np.array([4.25]), "iterations_per_step": np.array([1.25])},
        2000.0,
    )
    for columns, expected in (
        (
            140,
            "  2000 of 4712 s  0 x real time  step 4.25 s  1.2 iterations  energy error 3e-07 J  -:-- left",
        ),
        (90, "  2000 of 4712 s  0 x real time  step 4.25 s  -:-- left"),
        (80, "  2000 of 4712 s  0 x real time  -:-- left"),
        (20, "  -:-- left"),
    ):
        monkeypatch.setenv("COLUMNS", str(columns))
        monkeypatch.setattr("sys.stderr", Terminal())
        line = RunProgress(load_scene("baseline"))
        line.show(chunk)
        text = line.stream.getvalue()
        assert text == f"\r[########............]  42 %{expected} \x1b[K"
    monkeypatch.setenv("COLUMNS", "140")
    chain = Chunk(
        np.array([1.0]), {"energy_error": np.array([2e-13])}, {"last_step": np.array([0.01])}, 1.0
    )
    line = RunProgress(load_scene("hanging-chain"))
    line.show(chain)
    assert line.texts(1.0, 50.0) == ("1 of 5 s", "50 x real time", "step 0.01 s", "energy error 2e-13")


@pytest.mark.parametrize(("quiet", "stream"), [(True, Terminal()), (False, io.StringIO())])
def test_no_progress_bar(quiet, stream, monkeypatch):
    """Nothing is drawn with `quiet`, nor into a pipe."""
    monkeypatch.setattr("sys.stderr", stream)
    shown = Progress(1.0, lambda done, speed: [], quiet)
    shown.stage("compiling")
    shown.update(1.0)
    shown.close()
    assert stream.getvalue() == "" and not shown.due


def test_a_log_has_a_line_a_minute(monkeypatch, capsys):
    """Where stderr is no terminal, stdout gets a line for every minute, none in the first. Nothing is on
    stderr, which has errors only."""
    now = [0.0]
    monkeypatch.setattr(progress.time, "perf_counter", lambda: now[0])
    shown = Progress(100.0, lambda done, speed: [f"{done:g} at {speed:g}", "more"])
    shown.stage("compiling the program of the start ...")
    for now[0], done in (
        (10.0, 0.0),
        (59.0, 49.0),
        (60.0, 50.0),
        (61.0, 51.0),
        (110.0, 95.0),
        (130.0, 100.0),
    ):
        shown.update(done)
    shown.close()
    now[0] = 200.0
    shown.update(100.0)
    written = capsys.readouterr()
    first, second = written.out.splitlines()
    assert first == " 50 %  50 at 1  more  00:50 left"
    assert second.startswith("100 %  100 at ") and written.err == ""


def test_second_interruption_does_not_wait():
    """The first signal only sets `asked`, the second raises; the earlier handlers come back."""
    before = signal.getsignal(signal.SIGINT)
    with Interrupts() as interrupts:
        signal.raise_signal(signal.SIGINT)
        assert interrupts.asked
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize("code", ExitCode)
def test_exit_codes_are_in_the_help(code, capsys):
    with pytest.raises(SystemExit):
        cli.main(["--help"])
    assert f"{code:d} " in capsys.readouterr().out


def test_scenes_lists_every_built_in_scene_on_its_own_line(capsys):
    assert cli.main(["scenes"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == builtin_names()
    assert all(len(line.split()) > 3 for line in lines)


def test_files_are_replaced_as_a_whole(tmp_path):
    """A reader sees the old file until the block ends. If the block raises, the old file stays and the
    temporary file goes."""
    path = tmp_path / "a.h5"
    with atomic_hdf5(path) as file:
        file["x"] = 1
    with atomic_hdf5(path, update=True) as file:
        file["y"] = 2
        with h5py.File(path) as old:
            assert list(old) == ["x"]
    with pytest.raises(KeyboardInterrupt), atomic_hdf5(path) as file:
        file["z"] = 3
        raise KeyboardInterrupt
    with h5py.File(path) as file:
        assert list(file) == ["x", "y"]
    with atomic_file(path, unique=True) as part:
        assert str(os.getpid()) in part.name
        part.write_text("text")
    assert path.read_text() == "text" and list(tmp_path.iterdir()) == [path]


def test_a_run_says_which_tethers_were_released_and_what_includes_them():
    """Releases after the last saved instant, and those of a scene without any, are not told."""
    scene = load_scene("baseline", {"event.time": [400.0, 200.0], "event.release": [5, 3]})
    still = "thrust, energies and powers still include"
    assert release_text(scene, 200.0) == f"  released   tether 3 at 200 s; {still} it"
    assert release_text(scene, 1e3) == f"  released   tether 3 at 200 s, tether 5 at 400 s; {still} them"
    assert release_text(scene, 100.0) == release_text(load_scene("baseline"), 1e3) == ""
    assert release_text(load_scene("hanging-chain"), 1e3) == ""
