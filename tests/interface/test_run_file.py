"""Run files: their contents, and resuming after an interruption.

Whatever ended a run early (Ctrl-C, kill -9, a failed step, an earlier t_end), its file opens, and
`--resume` gives a file that is bit-identical to that of an uninterrupted run. This holds for methods of
fixed steps, for collocation and for explicit methods. The processes that tests start find the programs in
the cache.
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
from dataclasses import replace
from typing import Any, NamedTuple

import h5py
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
import esail_jax.commands.run
import esail_jax.simulation.host
import esail_jax.simulation.programs
from esail_jax import cli
from esail_jax.files import run_file
from esail_jax.numerics.lockstep import select
from esail_jax.scenes.builtin_scenes import builtin_names
from esail_jax.scenes.scene import parse
from esail_jax.simulation.results import join
from esail_jax.simulation.statistics import Pending
from esail_jax.steppers.collocation import Collocation
from esail_jax.steppers.fixed_step import STEPS_PER_FACTORISATION
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
from esail_jax.steppers.runge_kutta import RungeKutta
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


CHAIN = """\
[chain]
rods = 3
mass = 0.1
length = 0.5
area = 1e-6
youngs_modulus = 1e9
[gravity]
acceleration = [0.0, -9.81, 0.0]
[initial]
rod_vector = [[0.0, -0.5, 0.0], [0.0, -0.5, 0.0], [0.5, 0.0, 0.0]]
rod_rate = [1.0, 0.0, 0.0]
[integrator]
method = "dopri8"
t_end = 1.6
[output]
interval = 0.007
"""

AUTOMATIC = small_sail.TEXT.replace("t_end = 80.0\nstep = 0.1", "t_end = 4000.0").replace("0.35", "17.5")
"""The small sail with the default method, whose steps are about a hundred times as long."""


class Kind(NamedTuple):
    """A method: a scene with 230 saved instants, its stepper, and the factor to all times of the tests."""

    text: str
    stepper: Any
    scale: float


KINDS = {
    "generalized-alpha": Kind(small_sail.TEXT, GeneralizedAlpha, 1.0),
    "collocation": Kind(AUTOMATIC, Collocation, 50.0),
    "dopri8": Kind(CHAIN, RungeKutta, 0.02),
}

SHORT_CALLS = {"MAX_ATTEMPTS": 320, "MAX_INSTANTS": 100}
"""Limits of a compiled call in these tests, so that runs of 230 instants consist of several calls. A call
of generalized-alpha ends between two saved instants."""


@pytest.fixture(scope="module", autouse=True)
def short_calls():
    """Lets the runs of these tests consist of several calls."""
    programs = esail_jax.simulation.programs
    with pytest.MonkeyPatch.context() as patch:
        for name, value in SHORT_CALLS.items():
            patch.setattr(programs, name, value)
        programs._compiled.cache_clear()
        yield
    programs._compiled.cache_clear()


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
def scenes(tmp_path_factory):
    """The scene file of every kind."""
    folder = tmp_path_factory.mktemp("scenes")
    paths = {name: folder / f"{name}.toml" for name in KINDS}
    for name, path in paths.items():
        path.write_text(KINDS[name].text)
    return paths


@pytest.fixture(scope="module")
def wholes(scenes, tmp_path_factory):
    """A function: the file of an uninterrupted run of a kind, which no test writes to."""
    folder = tmp_path_factory.mktemp("wholes")

    def of(kind):
        path = folder / f"{kind}.h5"
        if not path.exists():
            assert esail_run(scenes[kind], path) == 0
        return path

    return of


@pytest.fixture(scope="module")
def scene(scenes):
    return scenes["generalized-alpha"]


@pytest.fixture(scope="module")
def whole(wholes):
    """The file of a run with fixed steps to 80 s (two and a half compiled calls)."""
    return wholes("generalized-alpha")


def check_start_of(path, other):
    """Checks that a file is consistent: all datasets have equally many rows, which are bit-identical to
    `other`'s."""
    with h5py.File(path, "r") as a, h5py.File(other, "r") as b:
        rows = a["time"].shape[0]
        for group in ("observables", "numerics"):
            for name, data in a[group].items():
                assert data.shape[0] == rows
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
        assert attributes["schema_version"] == 2 and attributes["steps"] == 800
        assert attributes["wall_time"] > 0.0 and attributes["compile_time"] > 0.0
        assert attributes["device"]
        for package in ("esail_jax", "jax", "jaxlib", "numpy", "h5py"):
            assert re.match(r"\d+\.\d+", attributes[f"version_{package}"])
        assert parse(file["scene"][()].decode(), "file") == parse(small_sail.TEXT, "text")
        assert file["time"].attrs["unit"] == "s"
        assert attributes["result"] == "successful" and attributes["method"] == "generalized-alpha"
        assert attributes["rejected_steps"] == 0
        assert len(file["state/motion"]) and file["state"].attrs["rows"] == 229, "80 s is no whole interval"
        assert file["final/time"][()] == 80.0


@pytest.mark.parametrize("t_end", [80.0, 30.07, 0.35, 0.07])
def test_saved_times_are_zero_the_multiples_of_the_interval_and_the_end(t_end, scene, tmp_path):
    """This also holds if interval and t_end are no multiples of the step, and if t_end is less than the
    step. The end makes no step shorter: the blocks of steps are those of a longer run."""
    assert esail_run(scene, tmp_path / "a.h5", "--t-end", t_end) == 0
    with h5py.File(tmp_path / "a.h5", "r") as file:
        expected = [*np.arange(0.0, t_end - 1e-9, 0.35), t_end]
        assert file["time"][()].tolist() == expected
        assert file["observables/kinetic_energy"].shape == (len(expected),)
        blocks = np.ceil((t_end / 0.1 - 1e-9) / STEPS_PER_FACTORISATION)
        assert file.attrs["steps"] == blocks * STEPS_PER_FACTORISATION
        error = np.abs(file["observables/energy_balance_error"][()]).max()
        assert error < 1e-6 * file["observables/kinetic_energy"][0]


def test_quiet_says_nothing_and_a_pipe_gets_no_progress(scene, tmp_path, capsys):
    assert esail_run(scene, tmp_path / "a.h5", "--t-end", 1) == 0
    assert capsys.readouterr() == ("", "")
    assert cli.main(["run", str(scene), "-o", str(tmp_path / "b.h5"), "--t-end", "1"]) == 0
    out, err = capsys.readouterr()
    assert err == "" and "complete" in out


# Resuming


@pytest.mark.parametrize("kind", KINDS)
def test_resume_without_a_file_starts(kind, scenes, wholes, tmp_path):
    assert esail_run(scenes[kind], tmp_path / "a.h5", "--resume") == 0
    check_same(tmp_path / "a.h5", wholes(kind))


def test_resume_of_a_complete_run_changes_no_byte(scene, whole, tmp_path, capsys):
    path = tmp_path / "a.h5"
    path.write_bytes(whole.read_bytes())
    before = path.stat()
    assert esail_run(scene, path, "--resume") == 0
    after = path.stat()
    assert path.read_bytes() == whole.read_bytes()
    assert (after.st_ino, after.st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("first", [30.0, 35.0, 1.0, 68.0, 30.07, 0.07])
def test_a_later_end_continues_bit_for_bit(first, kind, scenes, wholes, tmp_path):
    """A run can be continued from any t_end.

    With fixed steps the first end lies within the first compiled call, within the second, within a block of
    steps, at the end of a call that is no multiple of the interval, within a step, or before the end of the
    first step. With collocation the first runs fit into one call.
    """
    path, scale = tmp_path / "a.h5", KINDS[kind].scale
    assert esail_run(scenes[kind], path, "--t-end", first * scale) == 0
    assert esail_run(scenes[kind], path, "--t-end", 80.0 * scale, "--resume") == 0
    check_same(path, wholes(kind))


@pytest.mark.parametrize("kind", KINDS)
def test_a_call_of_any_length_gives_the_same_bits(kind, scenes, wholes, tmp_path, monkeypatch):
    """The whole run and its first part fit into one compiled call each, which the other tests' runs do
    not."""
    monkeypatch.undo()
    programs, path, scale = esail_jax.simulation.programs, tmp_path / "a.h5", KINDS[kind].scale
    monkeypatch.setattr(programs, "MAX_ATTEMPTS", 4096)
    monkeypatch.setattr(programs, "MAX_INSTANTS", 256)
    monkeypatch.setattr(programs, "_compiled", programs._compiled.__wrapped__)
    assert esail_run(scenes[kind], path, "--t-end", 35.0 * scale) == 0
    assert esail_run(scenes[kind], path, "--resume") == 0
    check_same(path, wholes(kind))


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


def missing(state):
    del state["motion/state/now"]


def unknown(state):
    state["motion/state/more"] = 1.0


def of_another_shape(state):
    del state["motion/earlier"]
    state["motion/earlier"] = np.zeros(3)


def without_statistics(state):
    del state["pending"]


def of_the_first_version(state):
    del state["motion"]


@pytest.mark.parametrize(
    "change", [missing, unknown, of_another_shape, without_statistics, of_the_first_version]
)
def test_resume_of_a_checkpoint_of_another_version_is_refused(change, scene, whole, tmp_path, capsys):
    path = tmp_path / "a.h5"
    path.write_bytes(whole.read_bytes())
    with h5py.File(path, "r+") as file:
        file.attrs["status"] = "interrupted"
        change(file["state"])
    before = path.read_bytes()
    assert esail_run(scene, path, "--resume", "--t-end", 90) == 2
    out, err = capsys.readouterr()
    assert (out, path.read_bytes()) == ("", before)
    expected = f"`--resume` must continue a run of this version of esail_jax, but {path} is of another"
    assert err == f"{expected}\n"
    with pytest.raises(esail.RunFileError, match="of another"):
        esail_jax.commands.run.run_scene(
            esail.load_scene(scene, {"integrator.t_end": 90.0}), path, resume=True, quiet=True
        )


# Interruption


@pytest.mark.parametrize("place", ["progress", "collect", "write"])
@pytest.mark.parametrize("number", [1, 2, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_ctrl_c_anywhere_leaves_a_file_that_resumes_bit_for_bit(
    kind, place, number, scenes, wholes, tmp_path, monkeypatch, capsys
):
    """The signal comes while the results of a call are collected, written or shown, for the `number`-th
    time."""
    scene, whole = scenes[kind], wholes(kind)
    path, left = tmp_path / "a.h5", [number]
    owner, name = {
        "progress": (esail_jax.commands.run.Progress, "update"),
        "collect": (Pending, "values"),
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
    assert status_of(path) == "interrupted" and left[0] <= 0
    check_start_of(path, whole)
    monkeypatch.undo()
    assert esail_run(scene, path, "--resume") == 0
    check_same(path, whole)


def test_signal_handlers_are_put_back(scene, tmp_path):
    before = signal.getsignal(signal.SIGINT)
    assert esail_run(scene, tmp_path / "a.h5", "--t-end", 1) == 0
    assert signal.getsignal(signal.SIGINT) is before


OFTEN = (
    f"import esail_jax.simulation.programs as programs; vars(programs).update({SHORT_CALLS}); "
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


def compile_again(monkeypatch):
    """Lets every run compile its programs: they contain what a test has replaced."""
    programs = esail_jax.simulation.programs
    monkeypatch.setattr(programs, "_compiled", programs._compiled.__wrapped__)


def break_from(monkeypatch, stepper, start):
    """Lets every block that begins at `start` or later fail without a step."""
    original = stepper.block

    def block(self, model, state):
        found, steps = original(self, model, state)
        failed = replace(state, result=esail.RESULTS.nonfinite)
        late = state.time >= start - 1e-9
        return select(late, (failed, replace(steps, taken=steps.taken & False)), (found, steps))

    compile_again(monkeypatch)
    monkeypatch.setattr(stepper, "block", block)


@pytest.mark.parametrize("kind", KINDS)
def test_a_failed_run_keeps_what_was_good_and_says_why(kind, scenes, wholes, tmp_path, monkeypatch, capsys):
    scene, whole, (_, stepper, scale) = scenes[kind], wholes(kind), KINDS[kind]
    path = tmp_path / "a.h5"
    with monkeypatch.context() as patch:
        break_from(patch, stepper, 40.0 * scale)
        assert esail_run(scene, path) == 3
        out, err = capsys.readouterr()
        assert out == "" and err.count("\n") == 1 and "infinite" in err and "t = " in err
        rows = check_start_of(path, whole)
        with h5py.File(path, "r") as file:
            assert file.attrs["status"] == "failed" and file.attrs["message"] == err.strip()
            assert file.attrs["result"] == "nonfinite" and file.attrs["steps"] > 0
        with h5py.File(whole, "r") as file:
            times = file["time"][()]
        # Blocks of fixed steps end at 40 s; other blocks end somewhat later.
        assert rows >= (times <= 40.0 * scale + 1e-9).sum(), "every saved instant before the failure"
        assert times[rows - 1] <= (40.0 if kind == "generalized-alpha" else 70.0) * scale
        assert cli.main(["info", str(path)]) == 0
        assert err.strip() in capsys.readouterr().out
        loaded = esail.load(path)
        assert loaded.result == esail.RESULTS.nonfinite and loaded.stats["message"] == err.strip()
        assert loaded.final_state.time == times[rows - 1]
        assert err.strip() in repr(loaded)
        assert esail_run(scene, path, "--resume") == 3, "it fails again"
        check_start_of(path, whole)
    assert esail_run(scene, path, "--resume") == 0
    check_same(path, whole)


def test_a_step_that_fails_is_halved_six_times(scene, whole, tmp_path, monkeypatch, capsys):
    """A step that cannot be solved is tried with shorter steps, down to a 64th, in the same program."""
    original = GeneralizedAlpha.step

    def step(self, system, time, state, kept, rate):
        new, info = original(self, system, time, state, kept, rate)
        return new, info._replace(left=jnp.where(time >= 40.0 - 1e-9, jnp.inf, info.left))

    path = tmp_path / "a.h5"
    with monkeypatch.context() as patch:
        compile_again(patch)
        patch.setattr(GeneralizedAlpha, "step", step)
        assert esail_run(scene, path) == 3
    err = capsys.readouterr().err
    assert "At t = 40.0016 s with steps of 0.00156 s" in err
    with h5py.File(path, "r") as file:
        assert (file.attrs["result"], file.attrs["steps"]) == ("newton_diverged", 400)
        assert file.attrs["rejected_steps"] == 7
        assert file["time"][-1] == 114 * 0.35
    check_start_of(path, whole)
    assert esail_run(scene, path, "--resume") == 0
    check_same(path, whole)


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
        esail_jax.commands.run.compile_scene(esail.load_scene(scene, overrides))


# Python


@pytest.fixture(scope="module")
def solution(scene):
    return esail.simulate(str(scene))


@pytest.fixture(scope="module")
def solutions(scenes, solution):
    """A function: the solution of a kind."""
    made = {"generalized-alpha": solution}

    def of(kind):
        if kind not in made:
            made[kind] = esail.simulate(str(scenes[kind]))
        return made[kind]

    return of


def same_bits(a, b):
    """Whether two trees of arrays have the same structure and bits."""
    leaves = ([np.asarray(x) for x in jax.tree.leaves(tree)] for tree in (a, b))
    pairs = zip(*leaves, strict=True)
    return jax.tree.structure(a) == jax.tree.structure(b) and all(
        (x.dtype, x.shape, x.tobytes()) == (y.dtype, y.shape, y.tobytes()) for x, y in pairs
    )


def test_a_solution_is_a_mapping(solution):
    assert "voltage" in solution and "kinetic_energy" in solution and "nonsense" not in solution
    assert 0 not in solution and None not in solution
    names = list(solution)
    assert list(solution.keys()) == names == list(dict(solution)) and len(solution) == len(names)
    assert set(OBSERVABLES) <= set(names)
    assert all(dict(solution)[name] is solution[name] for name in names)
    assert [name for name, _ in solution.items()] == names
    assert solution.get("nonsense") is None
    with pytest.raises(KeyError):
        solution["nonsense"]
    assert solution.units()["kinetic_energy"] == "J"


def test_a_solution_says_what_it_is(solution, scene):
    lines = repr(solution).splitlines()
    count = len(solution)
    assert lines[0] == f"Solution: {count} observables at 230 instants from 0 to 80 s"
    assert re.fullmatch(r"  generalized-alpha: 800 steps in \d+\.\d\d s, compiling \d+\.\d\d s", lines[1])
    assert lines[2] == "  The run reached its end time." and len(lines) == 3
    shapes = jax.eval_shape(lambda x: esail.simulate(str(scene), {"voltage.value": x}), 20e3)
    assert repr(shapes) == f"Solution({count} observables at 230 instants, under a trace)"


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_goes_on_from_a_final_state(kind, solutions, tmp_path):
    """The final state of a file is that of the solution, and a run to a later end goes on from it. Step
    sizes and first guesses begin anew, so that the results agree within the errors of the method."""
    whole, scale = solutions(kind), KINDS[kind].scale
    first = esail.simulate(whole.scene, {"integrator.t_end": 35.0 * scale})
    assert first.final_state.time == 35.0 * scale
    path = tmp_path / "a.h5"
    esail.save(first, path)
    loaded = esail.load(path)
    assert same_bits(loaded.final_state, first.final_state)
    seen = []
    for state in (first.final_state, loaded.final_state):
        later = esail.simulate(whole.scene, start=state)
        assert later.time.tolist() == whole.time[100:].tolist() and later.time[0] == 35.0 * scale
        for name in later:
            exact = np.asarray(whole[name])
            size = np.nan_to_num(np.ptp(exact)) + 1e-3 * np.nan_to_num(abs(exact).max())
            if name in ("energy_balance_error", "energy_error"):
                size = np.ptp(whole["kinetic_energy"]) if name == "energy_balance_error" else 1.0
            np.testing.assert_allclose(later[name], exact[100:], rtol=0, atol=1e-4 * size, err_msg=name)
        seen.append(later)
    assert same_bits(dict(seen[0]), dict(seen[1]))
    assert seen[0].checkpoint is None, "the scene's own run would go on otherwise"


def test_a_run_that_is_not_the_scenes_own_cannot_be_resumed(scene, solution, tmp_path, capsys):
    """A run with `times`, `save` or `start` is saved without a checkpoint; its file stays."""
    path = tmp_path / "a.h5"
    esail.save(esail.simulate(str(scene), times=[1.0, 2.0]), path)
    before = path.read_bytes()
    assert esail_run(scene, path, "--resume") == 2
    assert (
        capsys.readouterr().err
        == f"`--resume` must continue a run with a checkpoint, but {path} has none\n"
    )
    assert path.read_bytes() == before
    with pytest.raises(ValueError, match="was read from a file"):
        esail.load(path).at(1.5)


@pytest.mark.parametrize("kind", KINDS)
def test_observables_at_a_time_are_those_of_a_run_that_saves_it(kind, solutions):
    solution, scale = solutions(kind), KINDS[kind].scale
    time = 23.456 * scale
    saved = esail.simulate(solution.scene, times=sorted({*solution.time, time}))
    row = int(np.searchsorted(saved.time, time))
    found = solution.at(time)
    assert list(found) == list(solution)
    assert same_bits(found, {name: saved[name][row] for name in saved})
    row = int(np.searchsorted(solution.time, 50.0 * scale))
    assert same_bits(
        solution.at(float(solution.time[row])), {name: solution[name][row] for name in solution}
    )
    for outside in (-1.0, 81.0 * scale):
        with pytest.raises(ValueError, match="must lie within the run"):
            solution.at(outside)


def test_observables_at_a_time_of_a_run_from_a_state(solution):
    """The run is taken again from where it began, and with the method that it had."""
    start = esail.simulate(solution.scene, {"integrator.t_end": 7.0, "voltage.value": 1e3}).final_state
    stepper = GeneralizedAlpha(jnp.asarray(0.05), jnp.asarray(0.5))
    later = esail.simulate(solution.scene, start=start, stepper=stepper, save=["kinetic_energy"])
    assert list(later) == ["kinetic_energy"] and later.stats["method"] == "generalized-alpha"
    found = later.at(float(later.time[9]))
    assert same_bits(found, {"kinetic_energy": later["kinetic_energy"][9]})


@pytest.mark.parametrize("kind", KINDS)
def test_the_chunks_of_a_run_are_its_solution(kind, solutions):
    solution = solutions(kind)
    chunks = list(esail.run(solution.scene))
    assert len(chunks) > 2
    assert np.concatenate([chunk.time for chunk in chunks]).tolist() == solution.time.tolist()
    for part in ("observables", "numerics"):
        joined = join([getattr(chunk, part) for chunk in chunks])
        assert joined.keys() == getattr(solution, part).keys()
        assert same_bits(joined, dict(getattr(solution, part)))
    reached = [chunk.reached for chunk in chunks]
    assert reached == sorted(reached)
    assert all(chunk.reached >= chunk.time[-1] - 1e-9 for chunk in chunks)


def test_progress_is_told_the_time_reached(solution):
    reached = []
    again = esail.simulate(solution.scene, progress=reached.append)
    assert same_bits(dict(again), dict(solution))
    assert reached == [chunk.reached for chunk in esail.run(solution.scene)]


def test_only_the_named_observables_are_saved(solution, tmp_path):
    names = ["tip_position_I", "kinetic_energy"]
    some = esail.simulate(solution.scene, save=names)
    assert list(some) == names
    for name in names:
        np.testing.assert_allclose(some[name], solution[name], rtol=1e-12)
    esail.save(some, tmp_path / "a.h5")
    assert set(esail.load(tmp_path / "a.h5")) == set(names)
    with pytest.raises(
        esail.SceneError, match=r"`save` must hold names of observables, but has 'nonsense'"
    ):
        esail.simulate(solution.scene, save=["nonsense"])


def test_given_times_are_saved(solution):
    times = [0.0, 1.0, 1.75, 2.1, 200 * 0.35]
    some = esail.simulate(solution.scene, times=times)
    assert some.time.tolist() == times
    rows = [0, 5, 6, 200]
    for name in solution:
        at = np.asarray(some[name])[[0, 2, 3, 4]]
        assert at.tobytes() == np.asarray(solution[name])[rows].tobytes(), name
    for bad in ([2.0, 1.0], [], [-1.0], [np.nan]):
        with pytest.raises(esail.SceneError, match=r"`times` must increase from 0 on, but is"):
            esail.simulate(solution.scene, times=bad)


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_stops_at_the_largest_number_of_steps(kind, solutions):
    solution = solutions(kind)
    most = solution.steps // 2
    with pytest.raises(esail.SimulationError, match="max_steps") as raised:
        esail.simulate(solution.scene, max_steps=most)
    assert raised.value.result == esail.RESULTS.too_many_steps
    cut = esail.simulate(solution.scene, max_steps=most, throw=False)
    assert cut.result == esail.RESULTS.too_many_steps and cut.stats["message"] == str(raised.value)
    assert most <= cut.steps < most + 2 * STEPS_PER_FACTORISATION
    good = np.isfinite(cut["kinetic_energy"])
    rows = int(good.sum())
    assert good[:rows].all() and 50 < rows < 200 and cut.time.tolist() == solution.time.tolist()
    for name in solution:
        values = np.asarray(cut[name])
        assert values[:rows].tobytes() == np.asarray(solution[name])[:rows].tobytes(), name
        assert np.isnan(values[rows:]).all(), name
    assert cut.final_state.time == solution.time[rows - 1]
    assert esail.simulate(solution.scene, max_steps=solution.steps).result == esail.RESULTS.successful
    for bad in (0, -1):
        with pytest.raises(esail.SceneError, match=r"`max_steps` must be a positive whole number"):
            esail.simulate(solution.scene, max_steps=bad)


def test_a_run_that_saves_nothing_before_it_fails_is_nan(solution):
    cut = esail.simulate(solution.scene, times=[70.0, 75.0], max_steps=100, throw=False)
    assert cut.result == esail.RESULTS.too_many_steps and list(cut) == list(solution)
    for name in solution:
        assert cut[name].shape == (2, *solution[name].shape[1:]) and np.isnan(cut[name]).all()


def test_a_solution_becomes_a_dataset(solution):
    pytest.importorskip("xarray")
    data = solution.to_xarray()
    assert set(data.data_vars) == set(solution)
    assert data["time"].attrs["units"] == "s"
    tips = data["tip_position_I"]
    assert tips.dims[:2] == ("time", "tether") and tips.attrs["units"] == "m"
    assert same_bits({n: data[n].values for n in solution}, {n: np.asarray(solution[n]) for n in solution})


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
    motion = esail_jax.simulation.host.restored(solution.checkpoint.motion, again.checkpoint.motion)
    assert jax.tree.all(jax.tree.map(np.array_equal, motion, solution.checkpoint.motion))
    assert again.checkpoint[1:3] == solution.checkpoint[1:3]
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
