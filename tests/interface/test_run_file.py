"""Run files: their contents, and resuming after an interruption.

Whatever ended a run early (Ctrl-C, kill -9, a failed step, an earlier t_end), its file opens, and
`--resume` gives a file that is bit-identical to that of an uninterrupted run. All runs share one structure
and so their programs; the processes that tests start find the programs in the cache.
"""

import contextlib
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time

import h5py
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
import esail_jax.commands.run
import esail_jax.simulation.march
from esail_jax import cli
from esail_jax.files import run_file
from esail_jax.observables.run_warning import STEP_ERRORS
from esail_jax.scenes.builtin_scenes import builtin_names
from esail_jax.scenes.scene import parse
from support import small_sail
from support.bits import check_same, esail_run, status_of
from support.quick import quickly

OBSERVABLES = {
    "coning_angle": "tether", "lagging_angle": "tether", "root_coning_angle": "tether",
    "root_lagging_angle": "tether", "tether_length": "tether", "max_axial_strain": "tether",
    "angular_velocity_B": "3", "euler_hub": "3", "euler_sail": "3", "sailing_angle": "",
    "precession_angle": "", "tip_position_I": "tether 3", "hub_position_I": "3", "rotation_IB": "3 3",
    "thrust_O": "3", "thrust_moment_O": "3", "reaction_O": "3", "reaction_moment_O": "3",
    "thrust_B": "tether 3", "thrust_moment_B": "tether 3", "reaction_B": "tether 3",
    "thrust_angle": "", "reaction_angle": "", "kinetic_energy": "", "elastic_energy": "",
    "dissipated_power": "", "external_power": "", "dissipated_energy": "", "external_work": "",
    "energy_balance_error": "", "smallest_tether_distance": "",
}  # fmt: skip
"""Observables of a sail with a hub, and their axes after time."""


@pytest.fixture(scope="module", autouse=True)
def compilation_cache():
    """Points the processes that these tests start to the tests' cache, by the rule for users without
    settings."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", os.path.dirname(jax.config.jax_compilation_cache_dir))
        for name in [name for name in os.environ if name.startswith(("JAX_COMPILATION", "JAX_PERSISTENT"))]:
            patch.delenv(name)
        yield


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "small.toml"
    path.write_text(small_sail.TEXT)
    return path


@pytest.fixture(scope="module")
def whole(scene, tmp_path_factory):
    """The file of an uninterrupted run to 80 s (two and a half compiled calls); no test writes to it."""
    path = tmp_path_factory.mktemp("whole") / "whole.h5"
    assert esail_run(scene, path) == 0
    return path


def check_start_of(path, other, failed=False):
    """Checks that a file is consistent: all datasets have equally many rows, which are bit-identical to
    `other`'s.

    The error estimate covers whole compiled calls. For a call that failed it keeps its value from before.
    """
    with h5py.File(path, "r") as a, h5py.File(other, "r") as b:
        rows = a["time"].shape[0]
        for group in ("observables", "numerics"):
            for name, data in a[group].items():
                assert data.shape[0] == rows
                if failed and name in STEP_ERRORS:
                    assert (data[()] <= b[group][name][:rows]).all()
                    continue
                assert data[()].tobytes() == b[group][name][:rows].tobytes(), f"{name} differs"
        assert a["time"][()].tobytes() == b["time"][:rows].tobytes()
        return rows


# What is in a file


def test_run_file_holds_every_observable_with_unit_symbol_axes_and_equation(whole):
    with h5py.File(whole, "r") as file:
        assert set(OBSERVABLES) <= set(file["observables"])
        for name, data in file["observables"].items():
            assert set(data.attrs) >= {"unit", "symbol", "axes", "equation"}, name
            assert data.attrs["unit"] and data.attrs["symbol"], name
            axes = list(data.attrs["axes"])
            assert axes[0] == "time" and len(axes) == data.ndim, name
            assert all(size == 2 for axis, size in zip(axes, data.shape, strict=True) if axis == "tether")
        for name, axes in OBSERVABLES.items():
            shape = tuple(2 if axis == "tether" else int(axis) for axis in axes.split())
            assert file["observables"][name].shape[1:] == shape, name
            assert list(file["observables"][name].attrs["axes"]).count("tether") == axes.count("tether")
            if name not in ("precession_angle", "euler_sail"):
                assert np.isfinite(file["observables"][name][()]).all(), name


def test_run_file_holds_how_the_solver_fared(whole):
    with h5py.File(whole, "r") as file:
        rows = file["time"].shape[0]
        assert {"hub", "coulomb"} <= set(file["numerics"].attrs["terms"])
        numerics = {name: data[()] for name, data in file["numerics"].items()}
        assert {len(values) for values in numerics.values()} == {rows}
        assert (numerics["iterations_per_step"][1:] >= 1.0).all()
        assert 0.0 < numerics["last_increment"].max() <= 1e-8
        assert 0.0 < numerics["residual"].max() < 1e-3
        assert numerics["constraint_violation"].max() < 1e-9


def test_run_file_says_what_ran_and_where(whole):
    with h5py.File(whole, "r") as file:
        attributes = dict(file.attrs)
        assert attributes["status"] == "complete" and attributes["message"] == ""
        assert attributes["schema_version"] == 1 and attributes["steps"] == 800
        assert attributes["wall_time"] > 0.0 and attributes["compile_time"] > 0.0
        assert attributes["device"]
        for package in ("esail_jax", "jax", "jaxlib", "numpy", "h5py"):
            assert re.match(r"\d+\.\d+", attributes[f"version_{package}"])
        assert parse(file["scene"][()].decode(), "file") == parse(small_sail.TEXT, "text")
        assert file["time"].attrs["unit"] == "s"
        assert len(file["state"]) and "position" in file["state"].attrs


@pytest.mark.parametrize("t_end", [80.0, 30.07, 0.35, 0.07])
def test_saved_times_are_zero_the_multiples_of_the_interval_and_the_end(t_end, scene, tmp_path):
    """This also holds if interval and t_end are no multiples of the step, and if t_end is less than the
    step."""
    assert esail_run(scene, tmp_path / "a.h5", "--t-end", t_end) == 0
    with h5py.File(tmp_path / "a.h5", "r") as file:
        expected = [*np.arange(0.0, t_end - 1e-9, 0.35), t_end]
        assert file["time"][()].tolist() == expected
        assert file["observables/kinetic_energy"].shape == (len(expected),)
        assert file.attrs["steps"] == int(np.ceil(t_end / 0.1 - 1e-9))
        error = np.abs(file["observables/energy_balance_error"][()]).max()
        assert error < 1e-6 * file["observables/kinetic_energy"][0]


def test_a_step_beyond_the_end_makes_one_short_step(scene, tmp_path):
    """A step greater than t_end is legal: the only step ends at t_end."""
    assert esail_run(scene, tmp_path / "a.h5", "--t-end", 0.05) == 0
    with h5py.File(tmp_path / "a.h5", "r") as file:
        assert file["time"][()].tolist() == [0.0, 0.05] and file.attrs["steps"] == 1
        assert file.attrs["status"] == "complete"


def test_quiet_says_nothing_and_a_pipe_gets_no_progress(scene, tmp_path, capsys):
    assert esail_run(scene, tmp_path / "a.h5", "--t-end", 1) == 0
    assert capsys.readouterr() == ("", "")
    assert cli.main(["run", str(scene), "-o", str(tmp_path / "b.h5"), "--t-end", "1"]) == 0
    out, err = capsys.readouterr()
    assert err == "" and "complete" in out


# Resuming


def test_resume_without_a_file_starts(scene, whole, tmp_path):
    assert esail_run(scene, tmp_path / "a.h5", "--resume") == 0
    check_same(tmp_path / "a.h5", whole)


def test_resume_of_a_complete_run_changes_no_byte(scene, whole, tmp_path, capsys):
    path = tmp_path / "a.h5"
    path.write_bytes(whole.read_bytes())
    before = path.stat()
    assert esail_run(scene, path, "--resume") == 0
    after = path.stat()
    assert path.read_bytes() == whole.read_bytes()
    assert (after.st_ino, after.st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    "first",
    [30.0, 35.0, 1.0, 68.0, 30.07, 0.07],
)
def test_a_later_end_continues_bit_for_bit(first, scene, whole, tmp_path):
    """A run can be continued from any t_end.

    The first end lies within the first compiled call, within the second, within a block of steps, at the
    end of a call that is no multiple of the interval, within a step, or before the end of the first step.
    """
    path = tmp_path / "a.h5"
    assert esail_run(scene, path, "--t-end", first) == 0
    assert esail_run(scene, path, "--t-end", 80, "--resume") == 0
    check_same(path, whole)


def test_resume_with_another_scene_is_refused(scene, whole, tmp_path, capsys):
    path = tmp_path / "a.h5"
    path.write_bytes(whole.read_bytes())
    for setting in (
        "voltage.value=20001.0",
        "integrator.step=0.05",
        "output.interval=0.5",
        "tethers.count=3",
    ):
        assert esail_run(scene, path, "--resume", "--set", setting) == 2
        err = capsys.readouterr().err
        assert err.count("\n") == 1 and re.match("`--resume` must .*, but ", err)
    assert path.read_bytes() == whole.read_bytes()


def test_resume_to_an_earlier_end_is_refused(scene, whole, tmp_path, capsys):
    """This holds for a finished run, and for a run that was interrupted after that end."""
    path = tmp_path / "a.h5"
    path.write_bytes(whole.read_bytes())
    for status in ("complete", "interrupted"):
        with h5py.File(path, "r+") as file:
            file.attrs["status"] = status
        before = path.read_bytes()
        assert esail_run(scene, path, "--resume", "--t-end", 10) == 2
        err = capsys.readouterr().err
        assert err.count("\n") == 1 and re.match("`--t-end` must .*, but ", err)
        assert path.read_bytes() == before


def test_resume_of_a_file_with_other_entries_is_refused(scene, whole, tmp_path, capsys):
    """A version with blocks of another length wrote the file; its checkpoint would belong to another
    time."""
    path = tmp_path / "a.h5"
    path.write_bytes(whole.read_bytes())
    with h5py.File(path, "r+") as file:
        file.attrs["status"] = "interrupted"
        file["state"].attrs["steps_per_entry"] = 7
    assert esail_run(scene, path, "--resume", "--t-end", 90) == 2
    assert "version" in capsys.readouterr().err


# Interruption


@pytest.mark.parametrize("place", ["progress", "collect", "write"])
@pytest.mark.parametrize("number", [1, 2, 4])
def test_ctrl_c_anywhere_leaves_a_file_that_resumes_bit_for_bit(
    place, number, scene, whole, tmp_path, monkeypatch, capsys
):
    """The signal comes while the results of a call are collected, written or shown, for the `number`-th
    time."""
    path, left = tmp_path / "a.h5", [number]
    owner, name = {
        "progress": (esail_jax.commands.run.Progress, "update"),
        "collect": (esail_jax.simulation.march.March, "_collect"),
        "write": (run_file.RunWriter, "_append"),
    }[place]
    monkeypatch.setattr(run_file, "CHECKPOINT_SECONDS", 0.0)
    monkeypatch.setattr(run_file, "COPY_SHARE", 1e9)
    original = getattr(owner, name)

    def interrupted(*arguments):
        result = original(*arguments)
        left[0] -= 1
        if left[0] == 0:
            signal.raise_signal(signal.SIGINT)
        return result

    monkeypatch.setattr(owner, name, interrupted)
    assert esail_run(scene, path) == 130
    assert capsys.readouterr().err.count("\n") == 1
    assert status_of(path) == "interrupted"
    check_start_of(path, whole)
    monkeypatch.undo()
    assert esail_run(scene, path, "--resume") == 0
    check_same(path, whole)


def test_signal_handlers_are_put_back(scene, tmp_path):
    before = signal.getsignal(signal.SIGINT)
    assert esail_run(scene, tmp_path / "a.h5", "--t-end", 1) == 0
    assert signal.getsignal(signal.SIGINT) is before


OFTEN = (
    "import sys, esail_jax.files.run_file as run_file; run_file.CHECKPOINT_SECONDS = 0.0; "
    "run_file.COPY_SHARE = 1e9; from esail_jax.cli import main; sys.exit(main(sys.argv[1:]))"
)
"""Code that runs the command and writes after every compiled call, so that it is often killed while it
writes."""


@contextlib.contextmanager
def process(scene, path, *more, code=OFTEN):
    """Runs the command in a process, which is ended on exit if it still runs."""
    command = [sys.executable, "-c", code, "run", str(scene), "-o", str(path), "--quiet", *map(str, more)]
    running = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield running
    finally:
        running.kill()
        running.communicate()


def wait_for_writing(running, path, before, deadline=60.0):
    """Waits until the process has replaced the file (`before`: its inode) or has ended."""
    end = time.monotonic() + deadline
    while running.poll() is None and time.monotonic() < end:
        with contextlib.suppress(FileNotFoundError):
            if path.stat().st_ino != before:
                return
        time.sleep(0.002)


@pytest.mark.parametrize("number", quickly([signal.SIGINT, signal.SIGTERM]))
def test_a_signal_to_the_process_ends_it_with_130_and_resumable(number, scene, tmp_path):
    path = tmp_path / "a.h5"
    with process(scene, path, "--t-end", 20000) as running:
        wait_for_writing(running, path, None)
        time.sleep(0.2)
        running.send_signal(number)
        out, err = running.communicate(timeout=60)
    assert (running.returncode, out, err.count("\n")) == (130, "", 1), err
    assert status_of(path) == "interrupted" and not path.with_name("a.h5.part").exists()
    with h5py.File(path, "r") as file:
        t_end = float(np.ceil(file["time"][-1]) + 30.0)
    assert t_end < 20000
    assert esail_run(scene, path, "--resume", "--t-end", t_end) == 0
    assert esail_run(scene, tmp_path / "b.h5", "--t-end", t_end) == 0
    check_same(path, tmp_path / "b.h5")


def kill_and_resume(kills, t_end, seed, scene, tmp_path):
    """Kills runs at random moments, checks the file and resumes each time; then finishes and compares.

    Returns the number of killed processes.
    """
    path, other, chance, killed = tmp_path / "a.h5", tmp_path / "b.h5", random.Random(seed), 0
    assert esail_run(scene, other, "--t-end", t_end) == 0
    for _ in range(kills):
        before = path.stat().st_ino if path.exists() else None
        with process(scene, path, "--t-end", t_end, "--resume") as running:
            wait_for_writing(running, path, before)
            time.sleep(chance.choice([0.0, chance.uniform(0.0, 0.02), chance.uniform(0.0, 0.3)]))
            running.kill()
            running.communicate()
            killed += running.returncode == -signal.SIGKILL
        if path.exists():
            check_start_of(path, other)
            assert status_of(path) in ("running", "complete")
            assert cli.main(["info", str(path)]) == 0
    assert esail_run(scene, path, "--t-end", t_end, "--resume") == 0
    check_same(path, other)
    return killed


@pytest.mark.slow
def test_kill_9_leaves_a_file_that_opens_and_resumes_bit_for_bit(scene, tmp_path):
    assert kill_and_resume(3, 1500.0, 1, scene, tmp_path) >= 2


MIDST = (
    "import os, signal, esail_jax.files.run_file as run_file; append, left = run_file.append, [100]\n"
    "def kill(data, values):\n"
    "    append(data, values)\n"
    "    left[0] -= 1\n"
    "    if left[0] == 0:\n"
    "        data.file.flush()\n"
    "        os.kill(os.getpid(), signal.SIGKILL)\n"
    "run_file.append = kill\n"
)
"""Code that kills itself in the third write, when some datasets have been extended."""


def test_kill_9_in_the_midst_of_a_write_leaves_a_consistent_file(scene, whole, tmp_path):
    path = tmp_path / "a.h5"
    with process(scene, path, code=MIDST + OFTEN) as running:
        running.communicate(timeout=100)
    assert running.returncode == -signal.SIGKILL and path.with_name("a.h5.part").exists()
    check_start_of(path, whole)
    assert status_of(path) == "running"
    assert esail_run(scene, path, "--resume") == 0
    check_same(path, whole)
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"]


def stopped(running):
    """Stops a process, as kill -9 first does; returns False if the process has already ended."""
    running.send_signal(signal.SIGSTOP)
    # With WNOWAIT `running` can still collect the exit status.
    found = os.waitid(os.P_PID, running.pid, os.WSTOPPED | os.WEXITED | os.WNOWAIT)
    return found.si_code == os.CLD_STOPPED


def content(folder):
    """Returns the name and the bytes of every file."""
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.slow
@pytest.mark.skipif(
    not hasattr(os, "waitid"),
    reason="only POSIX systems have SIGSTOP and waitid, which hold a process at the moment to be copied",
)
def test_fifty_moments_of_kill_9_leave_a_file_that_opens_and_resumes_bit_for_bit(scene, tmp_path):
    """Files that kill -9 leaves at fifty moments open, hold the start of an undisturbed run, and can be
    resumed.

    Five processes run, each from where the one before was killed. Each is stopped at ten random moments,
    and its folder is copied. At the tenth moment it is killed and leaves the same files as the copy, so
    that every copy is what a kill at its moment leaves.
    """
    folder, other, chance = tmp_path / "run", tmp_path / "b.h5", random.Random(2)
    folder.mkdir()
    assert esail_run(scene, other, "--t-end", 3000) == 0
    copies, killed = [], 0
    for _ in range(5):
        before = (folder / "a.h5").stat().st_ino if copies else None
        with process(scene, folder / "a.h5", "--t-end", 3000, "--resume") as running:
            wait_for_writing(running, folder / "a.h5", before)
            for last in (False,) * 9 + (True,):
                if chance.random() < 0.5:
                    wait_for_writing(running, folder / "a.h5", (folder / "a.h5").stat().st_ino)
                time.sleep(chance.choice([0.0, chance.uniform(0.0, 0.01), chance.uniform(0.0, 0.03)]))
                if not stopped(running):
                    break
                copies.append(tmp_path / f"copy {len(copies)}")
                shutil.copytree(folder, copies[-1])
                running.send_signal(signal.SIGKILL if last else signal.SIGCONT)
            running.communicate(timeout=60)
            if running.returncode == -signal.SIGKILL:
                killed += 1
                assert content(folder) == content(copies[-1])
    assert killed >= 4 and len(copies) >= 40
    parts = [check_start_of(copy / "a.h5", other) for copy in copies]
    assert len(set(parts)) >= 15, "moments all over the run"
    assert any((copy / "a.h5.part").exists() for copy in copies), "some in the midst of a write"
    for copy in copies:
        path = copy / "a.h5"
        assert status_of(path) == "running"
        assert cli.main(["info", str(path)]) == 0
        assert esail_run(scene, path, "--t-end", 3000, "--resume") == 0
        check_same(path, other)
        assert [left.name for left in copy.iterdir()] == ["a.h5"]


# Failure


def break_from(monkeypatch, start):
    """Lets every step from `start` on fail, as if its equations could not be solved."""
    original = esail_jax.simulation.march.March._call

    def call(self, entry, carry, *, repair):
        carry, (seen, info) = original(self, entry, carry, repair=False)
        if entry.kind == "march" and entry.end > start:
            late = entry.start + entry.step * jnp.arange(1, self.plan.steps_per_entry + 1) > start + 1e-9
            bad = jnp.where(late[:, None], jnp.inf, info.increment)
            carry, info = carry._replace(failed=jnp.ones((), int)), info._replace(increment=bad, left=bad)
            count = sum(row[0] <= start + 1e-9 for row in entry.rows)
            seen = {name: x.at[count:].set(jnp.nan) for name, x in seen.items()}
        return carry, (seen, info)

    monkeypatch.setattr(esail_jax.simulation.march, "MAX_HALVINGS", 0)
    monkeypatch.setattr(esail_jax.simulation.march.March, "_call", call)


def test_a_failed_run_keeps_what_was_good_and_says_why(scene, whole, tmp_path, monkeypatch, capsys):
    path = tmp_path / "a.h5"
    break_from(monkeypatch, 40.0)
    assert esail_run(scene, path) == 3
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and "t = 40.1 s" in err
    with h5py.File(whole, "r") as file:
        good = int((file["time"][()] <= 40.0 + 1e-9).sum())
    assert check_start_of(path, whole, failed=True) == good, "every saved instant before the failure"
    with h5py.File(path, "r") as file:
        assert file.attrs["status"] == "failed" and file.attrs["message"] == err.strip()
    assert cli.main(["info", str(path)]) == 0
    assert err.strip() in capsys.readouterr().out
    assert esail.load(path).result != esail.RESULTS.successful
    assert esail_run(scene, path, "--resume") == 3, "it fails again"
    monkeypatch.undo()
    assert esail_run(scene, path, "--resume") == 0
    check_same(path, whole)


def test_all_halvings_of_a_repair_share_their_programs(scene, tmp_path, monkeypatch, capsys):
    """A failing part of a run is repeated with shorter steps, down to a 64th, all with the same programs.

    Steps and observables are compiled once more each, not once for every step size.
    """
    original = esail_jax.simulation.march.March._call

    def call(self, entry, carry, *, repair):
        carry, found = original(self, entry, carry, repair=repair)
        return (carry._replace(failed=jnp.ones((), int)) if entry.kind == "march" else carry), found

    monkeypatch.setattr(esail_jax.simulation.march.March, "_call", call)
    programs = esail_jax.simulation.march.step_entry_jitted, esail_jax.simulation.march.look_at_entry_jitted
    before = [program._cache_size() for program in programs]
    assert esail_run(scene, tmp_path / "a.h5") == 3
    assert "with steps of 0.00156 s" in capsys.readouterr().err
    assert [program._cache_size() for program in programs] == [1 + size for size in before]


@pytest.mark.slow
def test_a_spin_that_nothing_holds_is_refused_before_anything_is_written(scene, tmp_path, capsys):
    """Elements with engineering strain have no equilibrium above some spin rate, which is an error of the
    input."""
    options = ("--set", "tethers.strain=engineering", "--set", "initial.spin_rate=0.2")
    assert esail_run(scene, tmp_path / "a.h5", *options) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and re.match(r"`initial\.spin_rate` must .*, but is 0\.2", err)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_spin_whose_only_equilibrium_is_folded_is_refused(scene):
    """Above the spin rate that a tether can hold, only folded elements are in equilibrium; they are
    refused."""
    overrides = {"tethers.strain": "engineering", "initial.spin_rate": 0.5}
    with pytest.raises(esail.SceneError, match=r"initial\.spin_rate"):
        esail_jax.commands.run.prepare(esail.load_scene(scene, overrides))


# Python


@pytest.fixture(scope="module")
def solution(scene):
    return esail.simulate(str(scene))


def test_simulate_and_the_command_give_the_same_file(solution, whole, tmp_path):
    esail.save(solution, tmp_path / "a.h5")
    check_same(tmp_path / "a.h5", whole)
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"], "temporary files stay"


def test_load_gives_back_what_was_saved(solution, tmp_path):
    path = tmp_path / "a.h5"
    esail.save(solution, str(path))
    again = esail.load(str(path))
    assert again.scene == solution.scene and again.steps == solution.steps
    assert again.time.tobytes() == solution.time.tobytes()
    assert set(again.observables) == set(solution.observables)
    for name in solution.observables:
        assert np.asarray(again[name]).tobytes() == np.asarray(solution[name]).tobytes(), name
    assert jax.tree.all(jax.tree.map(np.array_equal, again.checkpoint.carry, solution.checkpoint.carry))
    assert again.result == esail.RESULTS.successful
    assert set(again.stats["terms"]) == set(solution.stats["terms"])
    esail.save(again, tmp_path / "b.h5")
    check_same(tmp_path / "b.h5", path)


def test_save_overwrites_only_when_told(solution, tmp_path):
    path = tmp_path / "a.h5"
    path.write_text("precious")
    with pytest.raises(FileExistsError, match=r"a\.h5"):
        esail.save(solution, path)
    assert path.read_text() == "precious"
    esail.save(solution, path, overwrite=True)
    assert status_of(path) == "complete"


def test_a_saved_solution_can_be_resumed(scene, whole, tmp_path):
    esail.save(esail.simulate(str(scene), {"integrator.t_end": 30.0}), tmp_path / "a.h5")
    assert esail_run(scene, tmp_path / "a.h5", "--resume") == 0
    check_same(tmp_path / "a.h5", whole)


def test_load_refuses_a_file_that_is_no_run(tmp_path):
    (tmp_path / "a.h5").write_text("precious")
    with pytest.raises(esail.RunFileError, match=r"a\.h5"):
        esail.load(tmp_path / "a.h5")
    with pytest.raises(esail.RunFileError, match="does not exist"):
        esail.load(tmp_path / "b.h5")


# Other commands


def test_info_says_what_ran_how_it_ended_and_how_fast(whole, capsys):
    assert cli.main(["info", str(whole)]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    for word in (
        "complete",
        "2 tethers x 2 elements",
        "coulomb",
        "generalized-alpha",
        "800 steps",
        "compiling",
    ):
        assert word in out


def test_scenes_lists_every_built_in_scene_on_its_own_line(capsys):
    assert cli.main(["scenes"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == builtin_names()
    assert all(len(line.split()) > 3 for line in lines)


def test_the_package_runs_as_a_module(whole):
    environment = os.environ | {"PYTHONWARNINGS": "error"}
    done = subprocess.run(
        [sys.executable, "-m", "esail_jax", "info", str(whole)],
        capture_output=True,
        text=True,
        env=environment,
    )
    assert (done.returncode, done.stderr) == (0, "") and "complete" in done.stdout


# The last test of the file, because it drops the programs that the others share.
def test_load_compiles_nothing(whole, nothing_compiles):
    assert esail.load(whole)["kinetic_energy"].shape == (230,)
