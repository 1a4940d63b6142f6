"""Sizes that no machine can compute are refused in one line, before anything is compiled."""

import re

import pytest

import esail_jax as esail
from esail_jax.cli import main
from esail_jax.scenes import integration


@pytest.mark.parametrize(
    ("scene", "overrides", "message"),
    [
        ("baseline", {"tethers.count": 10**20}, "`tethers.count` must leave a model that fits"),
        ("baseline", {"tethers.elements": 10**9}, "`tethers.elements` must leave a model that fits"),
        ("hanging-chain", {"chain.rods": 10**12}, "`chain.rods` must leave a model that fits"),
        ("baseline", {"integrator.t_end": 1e9, "output.interval": 1.0}, "`output.interval` must leave"),
        ("baseline", {"output.interval": 5e-324}, "`output.interval` must leave"),
        ("baseline", {"integrator.step": 5e-324}, "`integrator.step` must leave at most"),
        ("baseline", {"integrator.tolerance": 1e-17}, "`integrator.tolerance` must lie in"),
    ],
)  # fmt: skip
def test_an_absurd_size_is_refused(scene, overrides, message, nothing_compiles):
    with pytest.raises(esail.SceneError, match=re.escape(message)):
        esail.load_scene(scene, overrides)


def test_the_limit_of_memory_is_that_of_the_machine(monkeypatch):
    """60 elements need some 3 MB of arrays; a machine of 1 MB has no room for them."""
    esail.load_scene("baseline")
    monkeypatch.setattr(integration, "memory_of_machine", lambda: 1e6)
    with pytest.raises(esail.SceneError, match=r"makes 60 elements, some 0\.003 GB"):
        esail.load_scene("baseline")


def test_the_command_writes_nothing(tmp_path, capsys):
    path = tmp_path / "a.h5"
    assert (
        main(["run", "baseline", "-o", str(path), "--t-end", "1e9", "--set", "output.interval=1e-3"]) == 2
    )
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "1e+08 saved instants" in error
    assert not path.exists()
