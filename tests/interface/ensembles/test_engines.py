"""Engines by their names, and schedulers that are not there."""

import pytest

from esail_jax.ensembles import engines
from esail_jax.ensembles.engines import address_of, engine_of
from esail_jax.errors import InputError


@pytest.mark.parametrize(
    ("name", "processes", "message"),
    [
        ("slurm", None, "`--engine` must be local, dask:ADDRESS or mpi, but is 'slurm'"),
        ("dask:", None, "`--engine` must be local, dask:ADDRESS or mpi, but is 'dask:'"),
        (
            "dask:tcp://a:1",
            2,
            "`--processes` must come with `--engine local`, but comes with dask:tcp://a:1",
        ),
        ("mpi", None, "`--engine` mpi must be started by `mpiexec -n P python -m mpi4py.futures"),
    ],
)
def test_engines_that_there_are_not(name, processes, message):
    with pytest.raises(InputError, match=f"^{message}"):
        engine_of(name, processes)


def test_the_file_of_a_scheduler(tmp_path, monkeypatch):
    """Its address is read; one that does not come, or is no such file, is an error after a while."""
    monkeypatch.setattr(engines, "CONNECT_SECONDS", 0.2)
    path = tmp_path / "many.json"
    path.write_text('{"address": "tcp://10.0.0.1:8786", "workers": {}}')
    assert address_of(str(path)) == "tcp://10.0.0.1:8786" and address_of("tcp://b:1") == "tcp://b:1"
    for text in ("[]", "{}", "no"):
        path.write_text(text)
        with pytest.raises(ValueError):
            address_of(str(path))
    with pytest.raises(FileNotFoundError):
        address_of(str(tmp_path / "none.json"))
    message = f"`--engine` must name a scheduler of Dask, but {tmp_path}/none.json is none: "
    with pytest.raises(InputError, match=f"^{message}"), engine_of(f"dask:{tmp_path}/none.json")():
        pass
