"""The chunks of a run, which a program keeps while the run goes on."""

import pytest

import esail_jax as esail


@pytest.mark.nightly
def test_a_chunk_keeps_no_more_memory_than_its_rows(small):
    """With few saved instants, a call of the compiled program passes few of the instants that its window
    has room for. A view would keep the memory of the whole window: 250 times as much for hourly output."""
    (chunk,) = esail.run("baseline", small, times=[0.0, 10.0, 20.0])
    assert len(chunk.time) == 3
    views = [
        name
        for part in (chunk.observables, chunk.numerics)
        for name, x in part.items()
        if x.base is not None
    ]
    assert not views
