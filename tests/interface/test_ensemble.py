"""Ensembles: equality with single runs, resuming after an interruption, and independent processes."""

import dataclasses
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

import esail_jax as esail
import esail_jax.cores
from esail_jax.cli import main
from esail_jax.commands.ensemble import publish_pieces, start_worker, task_of
from esail_jax.ensembles import (
    OUTCOMES,
    MemberRunner,
    Normal,
    Uniform,
    draw,
    load_ensemble,
    parse_variation,
    sensitivities,
    simulate_members,
    spread,
)
from esail_jax.ensembles.ensemble_file import pieces_in
from esail_jax.plotting.ensemble import plot_ensemble

SMALL = {
    "tethers.count": 3,
    "tethers.elements": 2,
    "integrator.t_end": 200.0,
    "output.interval": 20.0,
}
VARY = ("tethers.length[*]=normal:10e3:10", "initial.spin_rate=uniform:3.9e-3:4.1e-3")
SIGNALS = (
    "tip_position_I",
    "coning_angle",
    "angular_velocity_B",
    "thrust_O",
    "rotation_IB",
    "kinetic_energy",
)


@pytest.fixture(scope="module")
def scene():
    return esail.load_scene("baseline", SMALL)


@pytest.fixture(scope="module")
def inputs(scene):
    return draw(scene, [parse_variation(text) for text in VARY], 12, 3)


@pytest.fixture(scope="module")
def ensemble(scene, inputs):
    return simulate_members(scene, inputs)


def arguments(folder, members=12, seed=3, vary=VARY, **more):
    found = ["ensemble", "baseline", "-o", str(folder), "--members", str(members), "--seed", str(seed)]
    for text in vary:
        found += ["--vary", text]
    for key, value in SMALL.items():
        found += ["--set", f"{key}={value}"]
    for name, value in more.items():
        found += [f"--{name}"] + ([] if value is True else [str(value)])
    return [*found, "--quiet"]


def same(a, b):
    """Tells whether two ensembles are bit-identical; NaN equals NaN."""
    return all(np.array_equal(a[name], b[name], equal_nan=True) for name in a.rows)


@pytest.mark.slow
def test_members_are_single_runs(scene, inputs, ensemble):
    """Members agree with single runs to the rounding of 50 steps, 1e-12 of a signal's magnitude.

    The program is another one with the same arithmetic. Transverse angular rates are sums that cancel.
    """
    assert ensemble.complete.all() and not any(ensemble.messages)
    for member in (0, 7):
        run = esail.simulate(scene, {key: x[member] for key, x in inputs.items()})
        assert run.steps == ensemble.steps[member]
        for name in SIGNALS:
            size = np.abs(run[name]).max()
            assert np.abs(run[name] - ensemble[name][member]).max() < 1e-12 * size, name
    assert np.ptp(ensemble["coning_angle"][:, -1, 0]) > 1e-6  # members differ


def test_every_core_takes_a_member(scene, inputs, ensemble, monkeypatch):
    """With two cores two members run at a time, with the same results.

    Each waits for the other to begin, which would fail if they ran one after the other.
    """
    barrier, one = threading.Barrier(2, timeout=30.0), MemberRunner._run_one

    def together(self, member):
        barrier.wait()
        return one(self, member)

    monkeypatch.setattr("esail_jax.ensembles.member_runner.cores", lambda: 2)
    monkeypatch.setattr(MemberRunner, "_run_one", together)
    found = simulate_members(scene, {key: x[:4] for key, x in inputs.items()})
    assert all(np.array_equal(found[name], x[:4], equal_nan=True) for name, x in ensemble.rows.items())


@pytest.mark.parametrize(
    "processes, set_already, threads", [(None, None, "1"), (4, None, "1"), (2, None, "2"), (1, "3", "3")]
)
def test_processes_share_the_cores(processes, set_already, threads, monkeypatch):
    """Each process uses its share of four cores as threads; settings of the user are not changed."""
    monkeypatch.setattr("esail_jax.cores.cores", lambda: 4)
    monkeypatch.setenv("NPROC", set_already or "")
    if set_already is None:
        monkeypatch.delenv("NPROC")
    esail_jax.cores.share_cores(processes)
    assert os.environ["NPROC"] == threads


def test_simulate_members_draws_inputs(scene, inputs, ensemble):
    """With distributions and a number of members in place of inputs, members have the same numbers and
    rows."""
    vary = {
        "tethers.length": Normal(10e3, 10, per_tether=True),
        "initial.spin_rate": Uniform(3.9e-3, 4.1e-3),
    }
    found = simulate_members(scene, vary=vary, members=4, seed=3, observables=["coning_angle"])
    assert all(np.array_equal(x, inputs[key][:4]) for key, x in found.inputs.items())
    assert np.array_equal(found["coning_angle"], ensemble["coning_angle"][:4])
    assert "coning_angle" in found and "spin" not in found and list(dict(found)) == ["coning_angle"]
    text = "Ensemble(4 members, 4 complete; 11 instants to 200 s; observables coning_angle)"
    assert repr(found) == text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, r"`inputs` must be given, or `vary` and `members`, but neither is"),
        ({"inputs": {}}, r"`inputs` must have a value for every member, but is empty"),
        (
            {"vary": {"voltage.value": "uniform:1:2"}},
            "`members` must be given with `vary`",
        ),
        ({"vary": {}, "members": 0}, r"`members` must be a positive integer, but is 0"),
        (
            {"inputs": {"hub.radius": np.ones(2), "hub.height": np.ones(3)}},
            r"`inputs\[hub.height\]` must have 2 members, as `inputs\[hub.radius\]` does, but has 3",
        ),
        ({"inputs": {"hub.radius": np.ones(2)}, "members": 2}, "but both are"),
    ],
)
def test_members_that_are_none(scene, arguments, message):
    """Wrong arguments are refused in one line, before anything is compiled."""
    with pytest.raises(esail.SceneError, match=message):
        simulate_members(scene, **arguments)


@pytest.mark.slow
def test_lockstep_and_subsets(scene, inputs, ensemble):
    """Members in lockstep, as on a GPU, agree to rounding, also if the batch does not divide their
    number."""
    part = {key: x[:5] for key, x in inputs.items()}
    found = simulate_members(scene, part, SIGNALS, batch=3, lockstep=True)
    assert list(found.rows) == list(SIGNALS) and len(found) == 5
    for name in SIGNALS:
        size = np.abs(ensemble[name]).max()
        assert np.abs(found[name] - ensemble[name][:5]).max() < 1e-11 * size, name
    assert (found.steps == ensemble.steps[:5]).all()


@pytest.mark.slow
def test_failed_members_are_kept_apart(scene):
    """Failed members have NaN and a message, and are left out of the statistics; the others are not
    changed.

    One member has no equilibrium, and the steps of another cannot be solved.
    """
    stiff = scene.replace({"integrator.method": "collocation", "integrator.step": 8.0})
    inputs = {"initial.spin_rate": np.array([4e-3, 1.0, 4e-3]), "voltage.value": np.array([2e4, 2e4, 1e9])}
    found = simulate_members(stiff, inputs, ["kinetic_energy", "coning_angle"])
    assert found.complete.tolist() == [True, False, False] and found.failed.tolist() == [1, 2]
    assert "steady elongation" in found.messages[1] and "could not be solved" in found.messages[2]
    assert np.isfinite(found["kinetic_energy"][0]).all()
    assert np.isnan(found["kinetic_energy"][1]).all() and np.isnan(found["kinetic_energy"][2][1:]).all()
    seen = spread(found, "coning_angle")
    assert np.array_equal(seen.mean, found["coning_angle"][0]) and not seen.deviation.any()


def test_sensitivities():
    """Sensitivities of known numbers are right."""
    rng = np.random.default_rng(0)
    inputs = {"a": rng.normal(size=4000), "b": rng.normal(size=(4000, 3)), "c": rng.normal(size=4000)}
    y = 2.0 * inputs["a"] + inputs["b"].sum(1) + 1e-3 * rng.normal(size=4000)
    found = sensitivities(inputs, np.where(np.arange(4000) < 10, np.nan, y))
    # The shares are 4/7, 3/7 and 0, up to correlations within the sample, 1/sqrt(4000).
    assert abs(found.share["a"] - 4 / 7) < 0.03 and abs(found.share["b"] - 3 / 7) < 0.03
    assert found.share["c"] < 1e-3 and found.explained > 0.99999
    assert abs(found.correlation["a"] - np.sqrt(4 / 7)) < 0.05
    few = sensitivities({"b": rng.normal(size=(29, 3))}, np.arange(29.0))
    assert np.isnan(few.share["b"]) and np.isnan(few.explained)


@pytest.mark.slow
def test_spread(ensemble):
    """Quantiles lie between the extremes; the middle one is the median of the members."""
    seen = spread(ensemble, "coning_angle")
    rows = ensemble["coning_angle"]
    assert np.allclose(seen.quantiles[2], np.median(rows, axis=0), rtol=1e-12)
    assert (seen.minimum <= seen.quantiles[0]).all() and (seen.quantiles[-1] <= seen.maximum).all()
    for outcome in OUTCOMES:
        if outcome.observable in ensemble.rows:
            assert np.isfinite(outcome.of(ensemble)).all()


# ---- files ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The file of a finished ensemble that one process computed, by the command."""
    folder = tmp_path_factory.mktemp("ensemble") / "run"
    assert main(arguments(folder, processes=1)) == 0
    return folder / "ensemble.h5"


@pytest.mark.slow
def test_file(finished, scene, inputs, ensemble):
    """The file is a run file with `member` as first axis and with /inputs; its numbers are those of
    Python."""
    with h5py.File(finished) as file:
        assert file.attrs["status"] == "complete" and file.attrs["members"] == 12
        assert file.attrs["message"] == "" and file.attrs["steps"] == ensemble.steps.sum()
        assert file["inputs/tethers.length"].shape == (12, 3)
        assert file["inputs/initial.spin_rate"].shape == (12,)
        assert np.array_equal(file["inputs/tethers.length"][()], inputs["tethers.length"])
        assert np.array_equal(file["time"][()], ensemble.time)
        assert set(file["observables"]) == set(ensemble.rows)
        for name, data in file["observables"].items():
            assert list(data.attrs["axes"])[:2] == ["member", "time"]
            assert data.shape == ensemble[name].shape and data.attrs["unit"] is not None
    assert same(load_ensemble(finished), ensemble)
    assert list(finished.parent.iterdir()) == [finished]


@pytest.mark.slow
def test_info_and_figures(finished, tmp_path, capsys):
    """`esail info` describes an ensemble, and `plot` draws it; commands for one run refuse it.

    The figure of the shares of variance requires enough members.
    """
    assert main(["info", str(finished)]) == 0
    text = capsys.readouterr().out
    assert "12, seed 3" in text and "largest coning angle" in text and "initial.spin_rate" in text
    assert main(["plot", str(finished), "-o", str(tmp_path / "figures")]) == 0
    names = {Path(line).name for line in capsys.readouterr().out.split()}
    assert names == {"fans.png", "distributions.png"}
    whole = load_ensemble(finished)
    spin = dataclasses.replace(whole, inputs={"initial.spin_rate": whole.inputs["initial.spin_rate"]})
    assert {path.name for path in plot_ensemble(spin, tmp_path)} == names | {"drivers.png"}
    with pytest.raises(esail.RunFileError, match="of an ensemble"):
        esail.load(finished)
    assert main(["run", "baseline", "-o", str(finished), "--resume"]) == 2


@pytest.mark.slow
def test_going_on(finished, tmp_path, capsys):
    """Resuming with more members keeps the old members and adds those of the larger ensemble.

    A line is printed and nothing changes if the ensemble is complete, if resuming was not asked for, if the
    ensemble is another one, or if it has fewer members.
    """
    folder = tmp_path / "run"
    folder.mkdir()
    whole = folder / "ensemble.h5"
    whole.write_bytes(finished.read_bytes())
    before = whole.read_bytes()
    assert main([*arguments(folder), "--resume"]) == 0
    others = [
        arguments(folder),
        [*arguments(folder, seed=4), "--resume"],
        [*arguments(folder, vary=VARY[:1]), "--resume"],
        [*arguments(folder, members=6), "--resume"],
        [*arguments(folder, sampling="sobol"), "--resume"],
        [*arguments(folder, observables="coning_angle"), "--resume"],
    ]
    for command in others:
        assert main(command) == 2
        err = capsys.readouterr().err
        assert err.count("\n") == 1 and " must " in err, err
    assert whole.read_bytes() == before and list(folder.iterdir()) == [whole]
    assert main([*arguments(folder, members=15, processes=1), "--resume"]) == 0
    old, new = load_ensemble(finished), load_ensemble(whole)
    assert len(new) == 15 and new.complete.all()
    for name in old.rows:
        assert np.array_equal(old[name], new[name][:12], equal_nan=True)


BAD = [
    (["--members", "0"], "--members"),
    (["--seed", "-1"], "--seed"),
    (["--processes", "0"], "--processes"),
    (["--vary", "tethers.length=uniform:1"], "--vary"),
    (["--vary", "tethers.count=uniform:1:2"], "tethers.count"),
    (["--observables", "coning"], "observables"),
    (["--process", "1"], "--coordinator"),
    (["--distributed", "--processes", "2"], "--processes"),
    (["--distributed"], "--distributed"),
    (["--distributed", "--coordinator", "localhost:1", "--process", "1"], "--coordinator"),
]


@pytest.mark.parametrize(("more", "key"), BAD, ids=lambda x: " ".join(x) if isinstance(x, list) else x)
def test_bad_input(more, key, tmp_path, capsys):
    """Bad input gives one line and status 2, and nothing is written."""
    command = ["ensemble", "baseline", "-o", str(tmp_path / "run"), "--members", "2", *more]
    assert main(command) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and key in err and " must " in err, err
    assert not list(tmp_path.iterdir())


# ---- processes ------------------------------------------------------------------------------------


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


@pytest.mark.slow
def test_a_worker_computes_pieces(scene, tmp_path):
    """A worker process computes the pieces of a published task and ends."""
    task = task_of(scene, 2, VARY, 3, "random", ["coning_angle"])
    publish_pieces(task, tmp_path, np.arange(2), 2)
    assert start_worker(tmp_path).wait(timeout=300) == 0
    assert len(pieces_in(tmp_path)) == 2


@pytest.mark.slow
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


@pytest.mark.slow
def test_interrupted(tmp_path):
    """After SIGTERM the current piece is finished, and the file lacks the other members."""
    folder = tmp_path / "run"
    process = shell(arguments(folder, members=64, processes=1), stderr=subprocess.PIPE, text=True)
    wait_for_pieces(folder, 1, process)
    process.terminate()
    _, err = process.communicate(timeout=120)
    assert process.returncode == 130 and "missing" in err and "--resume" in err
    with h5py.File(folder / "ensemble.h5") as file:
        assert file.attrs["status"] == "interrupted"
    found = load_ensemble(folder / "ensemble.h5")
    missing = np.isnan(found.steps)
    assert 0 < missing.sum() < 64
    assert np.isnan(found["kinetic_energy"][missing]).all()
    assert np.isfinite(found["kinetic_energy"][~missing]).all()


def cluster(folder, *more):
    """Starts two processes that compute one ensemble with JAX's distributed runtime."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    common = [*arguments(folder, processes=2), "--distributed", "--coordinator", f"127.0.0.1:{port}", *more]
    return [shell([*common, "--process", str(i)], stderr=subprocess.PIPE) for i in range(2)]


@pytest.mark.slow
def test_two_distributed_processes(finished, tmp_path):
    """Two processes give the members of one process, also if one of them is killed.

    The other process then computes the rest. Only the current piece is lost, and a second call of both
    adds it.
    """
    folder = tmp_path / "run"
    first, second = cluster(folder)
    wait_for_pieces(folder, 1, first, second)
    first.kill()
    first.communicate()
    assert second.wait(timeout=300) == 0
    second.communicate()
    taken = 12 - len(pieces_in(folder)) if not (folder / "ensemble.h5").exists() else 0
    assert taken <= 1
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


@pytest.mark.slow
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


@pytest.mark.slow
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
