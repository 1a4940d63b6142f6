"""What is imported: commands that compute nothing start without JAX, and the package always has 64 bits."""

import os
import subprocess
import sys

import pytest

import esail_jax as esail

HEAVY = {"jax", "numpy", "scipy", "diffrax", "equinox", "h5py", "matplotlib"}
"""Libraries that take a tenth of a second or more to import."""


def in_new_process(code, **environment):
    """Returns what a new Python process prints."""
    clean = {name: value for name, value in os.environ.items() if name != "JAX_ENABLE_X64"}
    command = [sys.executable, "-c", code]
    return subprocess.run(
        command, env=clean | environment, capture_output=True, text=True, check=True
    ).stdout


@pytest.mark.parametrize(
    "arguments", [["--help"], ["run", "--help"], ["scenes"], ["run", "--no-such-option"]]
)
def test_a_command_without_computation_imports_no_heavy_library(arguments):
    code = f"""
import sys
from esail_jax.cli import main
try:
    main({arguments})
except SystemExit:
    pass
print("imported:", *sorted({HEAVY} & set(sys.modules)))
"""
    assert in_new_process(code).splitlines()[-1] == "imported:"


def test_a_wrong_scene_is_reported_without_jax(tmp_path):
    """A scene that does not exist, and one with a wrong value: one line, before JAX is imported."""
    wrong = [["no-such-scene"], ["baseline", "--set", "tethers.length=-3"]]
    for number, scene in enumerate(wrong):
        code = f"""
import sys
from esail_jax.cli import main
status = main(["run", *{scene}, "-o", {str(tmp_path / f"{number}.h5")!r}])
print(int(status), *sorted({HEAVY - {"numpy"}} & set(sys.modules)))
"""
        assert in_new_process(code).split() == ["2"]
        assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("first", ["jax", "esail_jax"])
def test_64_bits_whatever_is_imported_first(first):
    """Also where the environment asks for 32 bits: positions of kilometres need strains of 1e-6."""
    second = {"jax": "esail_jax", "esail_jax": "jax"}[first]
    code = f"import {first}, {second}; print({second}.__name__, __import__('jax').numpy.zeros(1).dtype)"
    assert in_new_process(code, JAX_ENABLE_X64="0").split()[-1] == "float64"


def test_every_public_name_is_there():
    for name in esail.__all__:
        assert getattr(esail, name).__module__.startswith("esail_jax."), name
    assert set(esail.__all__) <= set(dir(esail))
    with pytest.raises(AttributeError, match="no attribute 'no_such_name'"):
        _ = esail.no_such_name
