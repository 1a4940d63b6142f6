"""The driver on the host: the next call begins while the observables of the one before are evaluated."""

import threading

import numpy as np
import pytest

import esail_jax as esail
from esail_jax import load_scene
from esail_jax.simulation.host import HostRun, compile_scene
from esail_jax.simulation.results import join
from support.compiled_nothing import no_compilation
from support.quick import jit


@pytest.mark.drops_programs
@pytest.mark.parametrize("scene", ["baseline", "hanging-chain"])
def test_a_compiled_scene_compiles_nothing_more(scene, small):
    """The host computes with NumPy between the calls of its programs. An array of JAX among its numbers
    would be a program for every operation and every number of rows, in every process anew."""
    chain = {"chain.rods": 5, "integrator.t_end": 0.2, "output.interval": 0.1}
    compiled = compile_scene(load_scene(scene, small if scene == "baseline" else chain))
    with no_compilation():
        chunks = list(HostRun(compiled).chunks())
    assert sum(len(chunk.time) for chunk in chunks) > 2


FIXED = {
    "integrator.method": "generalized-alpha", "integrator.step": 1.0, "output.interval": 10.0,
    "tethers.element": "truss", "tethers.elements": 1, "tethers.bending": False,
    "tethers.second_moment": None, "tethers.bending_damping_time": None,
    "voltage.law": "on-off", "voltage.rise_time": 1.0,
}  # fmt: skip


@pytest.mark.nightly
def test_steps_before_a_switch_count():
    """A method begins afresh at a switch time, but steps are counted over the whole run: as many as in runs
    without a switch of the lengths of its three parts."""

    def steps(end, on, off):
        own = {"integrator.t_end": end, "voltage.on": on, "voltage.off": off}
        return esail.simulate("baseline", FIXED | own).steps

    part = {end: steps(end, 1e3, 2e3) for end in (10.0, 20.0)}
    assert part[20.0] >= 20
    assert steps(40.0, 20.0, 30.0) == part[20.0] + 2 * part[10.0] > steps(40.0, 1e3, 2e3)


def test_a_traced_run_takes_the_steps_of_the_host_across_switches():
    """Switch times that are no multiples of the step: one step ends there, and the next begins there.
    Host and trace agree to rounding, 1e-10 of the largest entry."""
    pulse = FIXED | {"integrator.t_end": 40.0, "voltage.on": 20.3, "voltage.off": 30.45}
    host = esail.simulate("baseline", pulse)

    def traced(spin):
        run = esail.simulate("baseline", pulse | {"initial.spin_rate": spin})
        return dict(run), run.steps

    rows, steps = jit(traced)(host.scene.initial.spin_rate)
    assert int(steps) == host.steps
    for name in ("tip_position_I", "elastic_energy", "angular_velocity_B", "voltage"):
        size = np.abs(host[name]).max()
        np.testing.assert_allclose(rows[name], host[name], rtol=0, atol=1e-10 * size, err_msg=name)


def test_a_chain_has_the_same_rows_in_many_calls():
    """The energy error of a row refers to the energies of all rows before it, also of earlier calls."""
    small = {"chain.rods": 5, "integrator.t_end": 3.0, "output.interval": 0.1}
    compiled = compile_scene(load_scene("hanging-chain", small))
    whole = join([chunk.observables for chunk in HostRun(compiled).chunks()])
    in_parts = HostRun(compiled._replace(programs=compiled.programs._replace(batches=1)))
    parts = [chunk.observables for chunk in in_parts.chunks()]
    assert len(parts) > 3
    for name, rows in join(parts).items():
        np.testing.assert_array_equal(rows, whole[name], err_msg=name)
    # A run that goes on from the last checkpoint has nothing to do, and knows the steps before.
    again = HostRun(compiled, in_parts.checkpoint)
    assert not list(again.chunks()) and again.steps == in_parts.steps > 3


@pytest.mark.nightly
def test_the_next_call_begins_before_the_observables_of_the_last_are_evaluated(small, monkeypatch):
    """The observables of a call wait until the next call has begun, which would take for ever if that
    waited for the observables. The rows have the same bits as those of a run in one call."""
    compiled = compile_scene(load_scene("baseline", small))
    (whole,) = HostRun(compiled).chunks()
    in_parts = HostRun(compiled._replace(programs=compiled.programs._replace(batches=1)))
    begin, look, begun, seen = HostRun._submitted, HostRun._look, threading.Semaphore(0), []

    def counted(self, *arguments):
        found = begin(self, *arguments)
        begun.release()
        return found

    def waiting(self, call):
        seen.append(call)
        ahead = 2 if len(seen) == 1 else 1
        assert call.ended or all(begun.acquire(timeout=300.0) for _ in range(ahead))
        return look(self, call)

    monkeypatch.setattr(HostRun, "_submitted", counted)
    monkeypatch.setattr(HostRun, "_look", waiting)
    parts = list(in_parts.chunks())
    assert len(seen) > 2
    rows = join([part.observables for part in parts])
    assert all(np.array_equal(rows[name], x) for name, x in whole.observables.items())
