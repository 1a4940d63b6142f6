"""What is imported: commands that compute nothing start without JAX, and the package always has 64 bits."""

from pathlib import Path

import pytest

import esail_jax as esail
from support.new_process import heavy_imports_of, output_of

BUILTIN = Path(esail.__file__).parent / "scenes" / "builtin"
"""Folder of the built-in scenes."""


@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        (["--help"], 0),
        (["run", "--help"], 0),
        (["scenes"], 0),
        (["init", "baseline"], 0),
        (["init", "no-such-scene"], 2),
        (["view", "no-such-file.h5", "-o", "a.html"], 2),
        (["run", "--no-such-option"], 2),
        (["run", "no-such-scene", "-o", "a.h5"], 2),
        (["run", "baseline", "--set", "tethers.length=-3", "-o", "a.h5"], 2),
        (["ensemble", "baseline", "--set", "tethers.length=-3", "--members", "2", "-o", "a"], 2),
        (["info", "no-such-file.h5"], 2),
        (["info", str(BUILTIN / "baseline.toml")], 0),
    ],
)
def test_a_command_without_computation_imports_no_heavy_library(arguments, status, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert heavy_imports_of(arguments) == (status, [])
    assert not list(tmp_path.iterdir()), "nothing is written"


@pytest.mark.parametrize("first", ["jax", "esail_jax"])
def test_64_bits_whatever_is_imported_first(first):
    """Also where the environment asks for 32 bits: positions of kilometres need strains of 1e-6."""
    second = {"jax": "esail_jax", "esail_jax": "jax"}[first]
    code = f"import {first}, {second}; print({second}.__name__, __import__('jax').numpy.zeros(1).dtype)"
    assert output_of(code, JAX_ENABLE_X64="0").split()[-1] == "float64"


def test_every_public_name_is_there():
    for name in esail.__all__:
        assert getattr(esail, name).__module__.startswith("esail_jax."), name
    assert set(esail.__all__) <= set(dir(esail))
    with pytest.raises(AttributeError, match="no attribute 'no_such_name'"):
        _ = esail.no_such_name


def test_packages_need_no_import_of_their_own():
    """`esail.design` and `esail.ensembles` are imported when they are used first."""
    code = (
        "import esail_jax as esail; print(esail.ensembles.Normal.__name__, esail.design.Objective.__name__)"
    )
    assert output_of(code).split() == ["Normal", "Objective"]
