"""Runs that fail: the file keeps what was good and says why, or nothing is written."""

import re
from dataclasses import replace

import h5py
import jax.numpy as jnp
import pytest

import esail_jax as esail
import esail_jax.commands.running
import esail_jax.simulation.advance
import esail_jax.simulation.programs
from esail_jax import cli
from esail_jax.compilation.stored import STORE
from esail_jax.numerics.lockstep import select
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
from kept_programs.program import _program_of
from support.bits import check_same, esail_run
from support.quick import quickly
from support.run_kinds import KINDS, check_start_of


def compile_again(monkeypatch):
    """Lets every run trace and compile its programs: they contain what a test has replaced."""
    programs, advance = esail_jax.simulation.programs, esail_jax.simulation.advance
    monkeypatch.setattr(advance, "block_of", advance.block_of.__wrapped__)
    monkeypatch.setattr(programs, "_compiled", programs._compiled.__wrapped__)
    monkeypatch.setattr("kept_programs.program._program_of", _program_of.__wrapped__)
    monkeypatch.setenv(STORE.variable, "off")


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


@pytest.mark.nightly
@pytest.mark.parametrize("kind", quickly(KINDS))
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


@pytest.mark.nightly
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


@pytest.mark.nightly
def test_a_spin_that_nothing_holds_is_refused_before_anything_is_written(scene, tmp_path, capsys):
    """Elements with engineering strain have no equilibrium above some spin rate, which is an error of the
    input."""
    options = ("--set", "tethers.strain=engineering", "--set", "initial.spin_rate=0.2")
    assert esail_run(scene, tmp_path / "a.h5", *options) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and re.match(r"`initial\.spin_rate` must .*, but is 0\.2", err)
    assert not list(tmp_path.iterdir())


@pytest.mark.nightly
def test_a_spin_whose_only_equilibrium_is_folded_is_refused(scene):
    """Above the spin rate that a tether can hold, only folded elements are in equilibrium; they are
    refused."""
    overrides = {"tethers.strain": "engineering", "initial.spin_rate": 0.5}
    with pytest.raises(esail.SceneError, match=r"initial\.spin_rate"):
        esail_jax.commands.running.compile_scene(esail.load_scene(scene, overrides))
