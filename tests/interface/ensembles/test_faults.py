"""Faults of engines: processes that are killed at random moments, stopped, or run out of memory, and the
process that started them killed. What comes out is, bit for bit, the ensemble of a quiet machine."""

import contextlib
import os
import random
import signal
import subprocess
import sys
import threading
import time
import warnings

import dask
import numpy as np
import psutil
import pytest
from distributed import Client, LocalCluster

import esail_jax as esail
from esail_jax.cli import main
from esail_jax.ensembles import load_ensemble, run_ensemble
from esail_jax.files.opening import WHOLE
from support.small_ensemble import SMALL, VARY, arguments, same

KILLS = 30
"""How often a process is killed."""

LONG = {**SMALL, "integrator.t_end": 8000.0, "output.interval": 800.0}
"""Members of some tenths of a second."""

MANY = 100
"""Members, so that work is left until all kills are done."""


def command(folder, *more):
    """The command of the long ensemble."""
    found = ["ensemble", "baseline", "-o", str(folder), "--members", str(MANY), "--seed", "3", "--quiet"]
    for text in VARY:
        found += ["--vary", text]
    for key, value in LONG.items():
        found += ["--set", f"{key}={value}"]
    return [*found, "--observables", "coning_angle,spin_rate", *more]


@pytest.fixture(scope="module")
def quiet(tmp_path_factory):
    """The ensemble that nobody disturbs, by one process."""
    folder = tmp_path_factory.mktemp("quiet") / "run"
    assert main(command(folder, "--processes", "1")) == 0
    return load_ensemble(folder / WHOLE)


def started(arguments, **options):
    """A process of the command line."""
    return subprocess.Popen([sys.executable, "-m", "esail_jax", *arguments], **options)


def children_of(process, recursive=False):
    """A function that lists the Python processes which a process has started."""
    family = psutil.Process(process.pid).children

    def listed():
        return [child.pid for child in family(recursive=recursive) if "python" in child.name()]

    return listed


def ended(process, chance, victims, kills, wait=(0.5, 4.0)):
    """Kills processes at random moments, until `kills` are killed or the process has ended. Returns how
    many were killed."""
    killed = 0
    while killed < kills and process.poll() is None:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(chance.uniform(*wait))
            break
        found = victims()
        if found:
            with contextlib.suppress(ProcessLookupError):
                os.kill(chance.choice(found), signal.SIGKILL)
                killed += 1
    process.wait(600)
    return killed


@pytest.mark.nightly
def test_processes_of_this_machine_are_killed(quiet, tmp_path):
    """30 processes are killed, while they start, load the program or compute, in as many ensembles as that
    takes; `--resume` goes on if a member has met four of them."""
    chance, killed, number = random.Random(1), 0, 0
    while killed < KILLS:
        folder, code = tmp_path / f"{number}", None
        while code != 0:
            process = started(command(folder, "--processes", "2", "--resume"), stderr=subprocess.DEVNULL)
            killed += ended(process, chance, children_of(process), KILLS - killed)
            code = process.returncode
            assert code in (0, 130)
        assert same(load_ensemble(folder / WHOLE), quiet)
        number += 1
    assert killed == KILLS


@pytest.mark.nightly
def test_the_driver_is_killed(quiet, tmp_path):
    """The first process is killed ten times; its processes end with it, and `--resume` loses nothing that
    was computed."""
    folder, chance = tmp_path / "run", random.Random(2)
    for _ in range(10):
        process = started(command(folder, "--processes", "2", "--resume"), stderr=subprocess.DEVNULL)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(chance.uniform(1.0, 12.0))
        workers = psutil.Process(process.pid).children() if process.poll() is None else []
        process.kill()
        process.wait()
        assert not psutil.wait_procs(workers, timeout=30)[1]
    assert main(command(folder, "--resume")) == 0
    assert same(load_ensemble(folder / WHOLE), quiet)
    assert [path.name for path in folder.iterdir()] == [WHOLE]


def worker_of(cluster):
    """A new worker of a Dask cluster, a process of its own."""
    command = [sys.executable, "-m", "distributed.cli.dask_worker", cluster.scheduler_address]
    options = ["--nthreads", "1", "--no-nanny", "--no-dashboard"]
    return subprocess.Popen([*command, *options], stderr=subprocess.DEVNULL)


@pytest.mark.nightly
def test_workers_of_dask_are_killed(quiet, tmp_path):
    """30 of two workers are killed, and others take their places, while ensembles are computed; `resume`
    goes on if a member has met four of them, or the program could not be prepared."""
    scene, chance, killed = esail.load_scene("baseline", LONG), random.Random(3), 0
    call = {"members": MANY, "vary": VARY, "seed": 3, "observables": ["coning_angle", "spin_rate"]}
    with LocalCluster(0, dashboard_address=None) as cluster, Client(cluster) as client:
        workers, done = [worker_of(cluster), worker_of(cluster)], threading.Event()

        def kill_some():
            nonlocal killed
            while killed < KILLS and not done.wait(chance.uniform(2.0, 6.0)):
                victim = workers.pop(chance.randrange(2))
                victim.kill()
                victim.wait()
                killed += 1
                workers.append(worker_of(cluster))

        killer = threading.Thread(target=kill_some)
        killer.start()
        number = 0
        while killed < KILLS or not number:
            found = None
            while found is None or not found.complete.all():
                resume, folder = found is not None, tmp_path / f"{number}"
                with warnings.catch_warnings(action="ignore"):  # of missing members
                    found = run_ensemble(
                        scene, folder, **call, executor=client.get_executor(), resume=resume
                    )
            assert same(found, quiet)
            number += 1
        done.set()
        killer.join()
        for worker in workers:
            worker.terminate()
            worker.wait()
    assert killed == KILLS


@pytest.mark.nightly
def test_a_worker_of_dask_is_stopped(quiet, tmp_path):
    """A worker that does not answer for longer than the patience of the scheduler is given up; its pieces
    are computed by the other, and what it still says later does no harm."""
    with (
        dask.config.set({"distributed.scheduler.worker-ttl": "3s"}),
        LocalCluster(2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):

        def stop_one():
            time.sleep(20.0)
            (worker, *_) = cluster.workers.values()
            pid = worker.process.process.pid
            os.kill(pid, signal.SIGSTOP)
            time.sleep(10.0)
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)

        stopper = threading.Thread(target=stop_one)
        stopper.start()
        found = run_ensemble(
            esail.load_scene("baseline", LONG), tmp_path / "run", members=MANY, vary=VARY, seed=3,
            observables=["coning_angle", "spin_rate"], executor=client.get_executor(),
        )  # fmt: skip
        stopper.join()
    assert same(found, quiet)


@pytest.mark.nightly
def test_ranks_of_mpi_are_killed(quiet, tmp_path):
    """A rank that is lost ends the whole job. After 30 of them the ensemble is complete, by `--resume`."""
    chance, killed, number = random.Random(4), 0, 0
    launcher = os.path.join(os.path.dirname(sys.executable), "mpiexec")
    call = [launcher, "-n", "2", sys.executable, "-m", "mpi4py.futures", "-m", "esail_jax"]
    while killed < KILLS:
        folder, code = tmp_path / f"{number}", None
        while code != 0:
            process = subprocess.Popen(
                [*call, *command(folder, "--engine", "mpi", "--resume")],
                stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            )  # fmt: skip
            once = min(1, KILLS - killed)
            killed += ended(process, chance, children_of(process, recursive=True), once, wait=(2.0, 12.0))
            code = process.returncode
        assert same(load_ensemble(folder / WHOLE), quiet)
        number += 1
    assert killed == KILLS


@pytest.mark.nightly
def test_a_stopped_process_of_this_machine(quiet, tmp_path):
    """The others go on; the piece of the stopped one comes when it is continued."""
    folder = tmp_path / "run"
    process = started(command(folder, "--processes", "2"), stderr=subprocess.DEVNULL)
    time.sleep(20.0)
    (worker, *_) = psutil.Process(process.pid).children()
    worker.suspend()
    time.sleep(8.0)
    worker.resume()
    assert process.wait(300) == 0 and same(load_ensemble(folder / WHOLE), quiet)


LIMITED = ["bash", "-c", 'ulimit -v 16777216; exec "$@"', "limited"]
"""Runs a command with 16 GiB of address space."""


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("function", "said"),
    [
        ("raises", "ZeroDivisionError: a member that fails"),
        ("greedy", "Unable to allocate 64"),
        ("deadly", "WorkerDiedError: a process ended by signal 9"),
    ],
)
def test_members_that_spoil_their_process(function, said, tmp_path):
    """Members that raise, need too much memory, or kill their process are missing, each with its reason,
    and all others are computed."""
    folder = tmp_path / "run"
    more = ["--reduce", f"support.greedy:{function}", "--processes", "2"]
    call = [*arguments(folder, observables="spin_rate"), *more]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(
        [*LIMITED, sys.executable, "-m", "esail_jax", *call],
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
    )
    _, err = process.communicate(timeout=600)
    found = load_ensemble(folder / WHOLE)
    fast = found.inputs["initial.spin_rate"] > 4.05e-3
    assert process.returncode == 130 and said in err and "--resume" in err and err.count("\n") == 1, err
    assert 0 < fast.sum() < 12 and np.array_equal(np.isnan(found.steps), fast)
    assert np.array_equal(np.isnan(found[f"spin_rate.{function}"]).any(1), fast)
