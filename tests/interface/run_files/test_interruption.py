"""Runs that a signal ends: the file opens, and a resumed run is bit-identical to an undisturbed one.

The processes that tests start find the programs in the cache.
"""

import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest

from esail_jax import cli
from esail_jax.commands.progress import Progress
from esail_jax.files import run_file
from esail_jax.simulation.statistics import Pending
from support.bits import check_same, esail_run, status_of
from support.quick import quickly
from support.run_kinds import KINDS, SHORT_CALLS, check_start_of


@pytest.mark.parametrize("place", ["progress", "collect", "write"])
@pytest.mark.parametrize("number", quickly([1, 2, 3]))
@pytest.mark.parametrize("kind", quickly(KINDS))
def test_ctrl_c_anywhere_leaves_a_file_that_resumes_bit_for_bit(
    kind, place, number, scenes, wholes, tmp_path, monkeypatch, capsys
):
    """The signal comes while the results of a call are collected, written or shown, for the `number`-th
    time."""
    scene, whole = scenes[kind], wholes(kind)
    path, left = tmp_path / "a.h5", [number]
    owner, name = {
        "progress": (Progress, "update"),
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


LONGEST_WAIT = 300.0
"""Time [s] after which a process is taken to hang. On a busy machine it may start for a minute."""


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


def wait_for_writing(running, path, before):
    """Waits until the process has replaced the file (`before`: its inode) or has ended."""
    end = time.monotonic() + LONGEST_WAIT
    while running.poll() is None and time.monotonic() < end:
        with contextlib.suppress(FileNotFoundError):
            if path.stat().st_ino != before:
                return
        time.sleep(0.002)


@pytest.mark.nightly
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_to_the_process_ends_it_with_130_and_resumable(number, scene, tmp_path):
    path = tmp_path / "a.h5"
    with process(scene, path, "--t-end", 20000) as running:
        wait_for_writing(running, path, None)
        time.sleep(0.2)
        running.send_signal(number)
        out, err = running.communicate(timeout=LONGEST_WAIT)
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


@pytest.mark.nightly
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
        running.communicate(timeout=LONGEST_WAIT)
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
    """The name and the bytes of every file."""
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.nightly
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
    assert esail_run(scene, other, "--t-end", 1200) == 0
    copies, killed = [], 0
    for _ in range(5):
        before = (folder / "a.h5").stat().st_ino if copies else None
        with process(scene, folder / "a.h5", "--t-end", 1200, "--resume") as running:
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
            running.communicate(timeout=LONGEST_WAIT)
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
        assert esail_run(scene, path, "--t-end", 1200, "--resume") == 0
        check_same(path, other)
        assert [left.name for left in copy.iterdir()] == ["a.h5"]
