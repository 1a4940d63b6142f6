"""The driver on the host: the next call begins while the observables of the one before are evaluated."""

import threading

import numpy as np
import pytest

from esail_jax import load_scene
from esail_jax.simulation.host import HostRun, compile_scene
from esail_jax.simulation.results import join
from support.compiled_nothing import no_compilation


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


@pytest.mark.nightly
def test_the_next_call_begins_before_the_observables_of_the_last_are_evaluated(small, monkeypatch):
    """The observables of a call wait until the next call has begun, which would take for ever if that
    waited for the observables. The rows have the same bits as those of a run in one call."""
    compiled = compile_scene(load_scene("baseline", small))
    (whole,) = HostRun(compiled).chunks()
    in_parts = HostRun(compiled._replace(programs=compiled.programs._replace(batches=1)))
    begin, look, begun, seen = HostRun._begin, HostRun._look, threading.Semaphore(0), []

    def counted(self, *arguments):
        found = begin(self, *arguments)
        begun.release()
        return found

    def waiting(self, call):
        seen.append(call)
        ahead = 2 if len(seen) == 1 else 1
        assert call.ended or all(begun.acquire(timeout=300.0) for _ in range(ahead))
        return look(self, call)

    monkeypatch.setattr(HostRun, "_begin", counted)
    monkeypatch.setattr(HostRun, "_look", waiting)
    parts = list(in_parts.chunks())
    assert len(seen) > 2
    rows = join([part.observables for part in parts])
    assert all(np.array_equal(rows[name], x) for name, x in whole.observables.items())
