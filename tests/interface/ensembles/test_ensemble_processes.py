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
from esail_jax.ensembles import load_ensemble, run_ensemble
from esail_jax.ensembles.driver import GRACE_SECONDS
from esail_jax.ensembles.ensemble_file import parts_of
from esail_jax.ensembles.pieces import files_in, pieces_of
from esail_jax.ensembles.processes import ProcessExecutor, WorkerDiedError
from esail_jax.files.locks import in_use
from support.small_ensemble import SMALL, VARY, arguments, same


def shell(command, **options):
    """Starts a process with these arguments in a session of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "esail_jax", *command], start_new_session=True, **options
    )


def members_in(folder):
    """Number of members in the pieces of a folder."""
    return sum(len(p.members) for path in files_in(parts_of(folder)) for p in pieces_of(path, arrays=False))


def wait_for_members(folder, count, *processes):
    """Waits until the pieces in a folder have this many members."""
    end = time.monotonic() + 300.0
    while members_in(folder) < count:
        assert time.monotonic() < end and all(p.poll() is None for p in processes)
        time.sleep(0.02)


def workers_of(process):
    """Identities of the processes that compute for a process."""
    listed = subprocess.run(["ps", "-eo", "pid,ppid"], capture_output=True, text=True, check=True).stdout
    pairs = [line.split() for line in listed.splitlines()[1:]]
    return [int(own) for own, parent in pairs if int(parent) == process.pid]


# ---- the executor --------------------------------------------------------------------------------


def test_processes_answer_and_are_replaced():
    """Results, and errors with their type, come back. A process that dies spoils its own request only, and
    the next one is answered by another."""
    with ProcessExecutor(1) as executor:
        first = executor.submit(os.getpid).result(timeout=60)
        assert first != os.getpid()
        with pytest.raises(ZeroDivisionError):
            executor.submit(divmod, 1, 0).result(timeout=60)
        with pytest.raises(esail.SceneError, match=r"^`a` must be positive, but is 0$"):
            executor.submit(refuse).result(timeout=60)
        assert executor.submit(os.getpid).result(timeout=60) == first
        with pytest.raises(WorkerDiedError, match=r"a process ended (by signal 9|with exit code)"):
            executor.submit(os.kill, first, getattr(signal, "SIGKILL", signal.SIGTERM)).result(timeout=60)
        with pytest.raises(WorkerDiedError, match="a process ended with exit code 3"):
            executor.submit(os._exit, 3).result(timeout=60)
        second = executor.submit(os.getpid).result(timeout=60)
        assert second != first
        executor.submit(print, "printed text does not spoil the answers").result(timeout=60)
        assert executor.submit(os.getpid).result(timeout=60) == second


def refuse():
    """Raises the error of a scene."""
    raise esail.SceneError("a", "be positive", "is 0")


OWNER = """
import os, sys, time
from esail_jax.ensembles.processes import ProcessExecutor
executor = ProcessExecutor(2)
pids = [executor.submit(os.getpid).result()]
futures = [executor.submit(time.sleep, 300) for _ in range(2)]
time.sleep(1.0)
print("at work", flush=True)
time.sleep(300)
"""


@pytest.mark.nightly
def test_processes_end_with_the_one_that_started_them():
    """Also if that one is killed, and they are in the middle of a request."""
    owner = subprocess.Popen([sys.executable, "-c", OWNER], stdout=subprocess.PIPE, text=True)
    assert owner.stdout.readline() == "at work\n"
    pids = workers_of(owner)
    assert len(pids) == 2
    owner.kill()
    owner.communicate()
    end = time.monotonic() + 30.0
    while any(os.path.exists(f"/proc/{pid}") for pid in pids):
        assert time.monotonic() < end
        time.sleep(0.05)


# ---- the command ---------------------------------------------------------------------------------


@pytest.mark.nightly
def test_killed_and_resumed(finished, tmp_path):
    """An ensemble that is killed with all its processes after two pieces and resumed is bit-identical to
    one that was not interrupted."""
    folder = tmp_path / "run"
    process = shell(arguments(folder, processes=2))
    wait_for_members(folder, 2, process)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    before = members_in(folder)
    assert not (folder / "ensemble.h5").exists() and before < 12
    assert main([*arguments(folder), "--resume"]) == 0
    assert same(load_ensemble(folder / "ensemble.h5"), load_ensemble(finished))


@pytest.mark.nightly
def test_interrupted(tmp_path):
    """After SIGTERM the current piece is finished, and the file lacks the other members."""
    folder = tmp_path / "run"
    process = shell(arguments(folder, members=64, processes=1), stderr=subprocess.PIPE, text=True)
    wait_for_members(folder, 1, process)
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
    while len(workers_of(process)) < 2 or not files_in(parts_of(folder)):
        assert time.monotonic() < end and process.poll() is None
        time.sleep(0.1)
    time.sleep(5.0)  # two members, or the compiler, are at work
    workers = workers_of(process)
    os.killpg(process.pid, getattr(signal, name))
    _, err = process.communicate(timeout=GRACE_SECONDS + 60.0)  # with time for putting the pieces together
    assert process.returncode == 130 and err.count("\n") == 1
    assert "40 of 40 members are missing" in err and "--resume" in err
    assert not [pid for pid in workers if os.path.exists(f"/proc/{pid}")]
    assert not in_use(folder)


@pytest.mark.nightly
def test_from_python(scene, finished, tmp_path):
    """`run_ensemble` gives the members of the command, bit for bit, and leaves the same file; a second call
    is refused, and one with `resume` changes nothing."""
    folder = tmp_path / "run"
    call = {"members": 12, "vary": VARY, "seed": 3}
    found = run_ensemble(scene, folder, **call)
    assert same(found, load_ensemble(finished)) and found.complete.all()
    assert [path.name for path in folder.iterdir()] == ["ensemble.h5"]
    with pytest.raises(esail.RunFileError, match="must not hold an ensemble yet"):
        run_ensemble(scene, folder, **call)
    before = (folder / "ensemble.h5").stat().st_mtime_ns
    assert same(run_ensemble(scene, folder, **call, resume=True), found)
    assert (folder / "ensemble.h5").stat().st_mtime_ns == before


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
