"""Ensembles of several processes or devices: the same members, also after some were killed."""

import os
import signal
import socket
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.cli import main
from esail_jax.commands.ensemble_here import publish_pieces, start_worker, task_of
from esail_jax.commands.ensemble_work import GRACE_SECONDS
from esail_jax.ensembles import load_ensemble
from esail_jax.ensembles.ensemble_file import pieces_in
from esail_jax.files.locks import FolderLock, in_use
from support.small_ensemble import SMALL, VARY, arguments, same


def shell(command, **options):
    """Starts a process with these arguments in a session of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "esail_jax", *command], start_new_session=True, **options
    )


def wait_for_pieces(folder, count, *processes):
    """Waits until the folder has this many pieces."""
    end = time.monotonic() + 300.0
    while len(pieces_in(folder)) < count:
        assert time.monotonic() < end and all(p.poll() is None for p in processes)
        time.sleep(0.02)


@pytest.mark.nightly
def test_a_worker_computes_pieces(scene, tmp_path):
    """A worker process computes the pieces of a published task and ends."""
    task = task_of(scene, 2, VARY, 3, "random", ["coning_angle"])
    publish_pieces(task, tmp_path, np.arange(2), 2)
    assert start_worker(tmp_path).wait(timeout=300) == 0
    assert len(pieces_in(tmp_path)) == 2


@pytest.mark.nightly
def test_killed_and_resumed(finished, tmp_path):
    """An ensemble that is killed with all its processes after two pieces and resumed is bit-identical to
    one that was not interrupted."""
    folder = tmp_path / "run"
    process = shell(arguments(folder, processes=2))
    wait_for_pieces(folder, 2, process)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    before = len(pieces_in(folder))
    assert not (folder / "ensemble.h5").exists() and before < 12
    assert main([*arguments(folder), "--resume"]) == 0
    assert same(load_ensemble(folder / "ensemble.h5"), load_ensemble(finished))


@pytest.mark.nightly
def test_interrupted(tmp_path):
    """After SIGTERM the current piece is finished, and the file lacks the other members."""
    folder = tmp_path / "run"
    process = shell(arguments(folder, members=64, processes=1), stderr=subprocess.PIPE, text=True)
    wait_for_pieces(folder, 1, process)
    process.terminate()
    _, err = process.communicate(timeout=300)
    assert process.returncode == 130 and "missing" in err and "--resume" in err
    with h5py.File(folder / "ensemble.h5") as file:
        assert file.attrs["status"] == "interrupted"
    found = load_ensemble(folder / "ensemble.h5")
    missing = np.isnan(found.steps)
    assert 0 < missing.sum() < 64
    assert np.isnan(found["kinetic_energy"][missing]).all()
    assert np.isfinite(found["kinetic_energy"][~missing]).all()


LONG = ["--set", "integrator.t_end=4e6", "--set", "output.interval=1e6", "--set", "tethers.elements=1"]
"""A run of minutes."""


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT"])
def test_interrupted_within_a_member(name, tmp_path):
    """A signal to the whole group of processes ends the command although every process is in the middle of
    a member, or compiles. No worker is left."""
    folder = tmp_path / "run"
    command = [*arguments(folder, members=40, processes=2, observables="coning_angle"), *LONG]
    process = shell(command, stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 300.0
    while len(list((folder / "parts").glob("*.claim"))) < 2:
        assert time.monotonic() < end and process.poll() is None
        time.sleep(0.1)
    os.killpg(process.pid, getattr(signal, name))
    _, err = process.communicate(timeout=GRACE_SECONDS + 60.0)  # with time for putting the pieces together
    assert process.returncode == 130 and err.count("\n") == 1
    assert "40 of 40 members are missing" in err and "--resume" in err
    listed = subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True, check=True).stdout
    assert not [line for line in listed.splitlines() if f"ensemble_worker {folder}" in line]
    assert not in_use(folder)


def cluster(folder, *more):
    """Starts two processes that compute one ensemble with JAX's distributed runtime."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    common = [*arguments(folder, processes=2), "--distributed", "--coordinator", f"127.0.0.1:{port}", *more]
    return [shell([*common, "--process", str(i)], stderr=subprocess.PIPE) for i in range(2)]


@pytest.mark.nightly
def test_two_distributed_processes(finished, tmp_path):
    """Two processes give the members of one process, also if one of them is killed.

    The other process then computes the rest, puts the pieces together, and says what is missing: only the
    current piece is lost, and a second call of both adds it. While both are at work, the folder is refused
    to others.
    """
    folder = tmp_path / "run"
    first, second = cluster(folder)
    wait_for_pieces(folder, 1, first, second)
    with pytest.raises(esail.RunFileError, match="in use"):
        FolderLock(folder)
    first.kill()
    first.communicate()
    _, err = second.communicate(timeout=300)
    missing = int(np.isnan(load_ensemble(folder / "ensemble.h5").steps).sum())
    assert missing <= 1 and second.returncode == (130 if missing else 0)
    assert (b"1 of 12 members are missing" in err and b"--resume" in err) == bool(missing)
    both = cluster(folder, "--resume")
    for process in both:
        process.communicate(timeout=300)
        assert process.returncode == 0
    assert same(load_ensemble(folder / "ensemble.h5"), load_ensemble(finished))
    assert [path.name for path in folder.iterdir()] == ["ensemble.h5"]


DEVICES = """
import sys
import jax
jax.config.update("jax_num_cpu_devices", 2)
import numpy as np
import esail_jax as esail
from esail_jax.ensembles import simulate_members
scene = esail.load_scene("baseline", eval(sys.argv[1]))
inputs = {"initial.spin_rate": np.array([3.9e-3, 4.0e-3, 4.1e-3])}
found = simulate_members(scene, inputs, ["coning_angle"], batch=3, lockstep=True)
assert len(jax.devices()) == 2 and found.complete.all() and len(found) == 3
np.save(sys.argv[2], found["coning_angle"])
"""


@pytest.mark.nightly
def test_devices_share_a_batch(scene, tmp_path):
    """Two devices compute three members, padded to four, in lockstep; they agree with single runs to
    rounding."""
    script, path = tmp_path / "devices.py", tmp_path / "coning.npy"
    script.write_text(DEVICES)
    subprocess.run([sys.executable, str(script), repr(SMALL), str(path)], check=True, timeout=400)
    for rate, found in zip((3.9e-3, 4.0e-3, 4.1e-3), np.load(path), strict=True):
        exact = esail.simulate(scene, {"initial.spin_rate": rate})["coning_angle"]
        assert np.abs(found - exact).max() < 1e-11 * np.abs(exact).max()


GRADIENT = """
import sys
import jax
import jax.numpy as jnp
import numpy as np
import esail_jax
from esail_jax.ensembles import mean_gradient
if len(sys.argv) > 2:
    jax.distributed.initialize(sys.argv[2], 2, int(sys.argv[3]))
inputs = {"a": np.arange(5.0), "b": np.ones((5, 2))}
def objective(p, member):
    return jnp.where(member["a"] == 3.0, jnp.nan, (p * member["b"] * member["a"]).sum() ** 2)
found = mean_gradient(objective, inputs)(np.array([1.0, 2.0]))
if jax.process_index() == 0:
    np.save(sys.argv[1], np.append(found.gradient, [found.mean, found.counted, jax.device_count()]))
"""


@pytest.mark.nightly
def test_gradient_of_a_mean_over_processes(tmp_path):
    """The mean of (p_1 a + p_2 a)^2 over members and its gradient are the same from one and from two
    processes.

    With a = 0, 1, 2, 4 (the member a = 3 is NaN and left out) and p = (1, 2) the mean is 9 x 21/4 and both
    slopes are 6 x 21/4. A collective reduction adds the sums of two processes.
    """
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    script = tmp_path / "gradient.py"
    script.write_text(GRADIENT)
    one, two = tmp_path / "one.npy", tmp_path / "two.npy"
    call = [sys.executable, str(script)]
    both = [subprocess.Popen([*call, str(two), address, str(i)], stderr=subprocess.PIPE) for i in range(2)]
    for process in both:
        _, err = process.communicate(timeout=400)
        assert process.returncode == 0, err[-2000:]
    subprocess.run([*call, str(one)], check=True, timeout=400)
    for path, devices in ((one, 1), (two, 2)):
        assert np.allclose(np.load(path), [31.5, 31.5, 47.25, 4, devices], rtol=1e-14)
