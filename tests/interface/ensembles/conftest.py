"""The small ensemble, in Python and in a file of the command."""

import pytest

import esail_jax as esail
from esail_jax.cli import main
from esail_jax.ensembles import draw, parse_variation, simulate_members
from support.small_ensemble import SMALL, VARY, arguments


@pytest.fixture(scope="package")
def scene():
    return esail.load_scene("baseline", SMALL)


@pytest.fixture(scope="package")
def inputs(scene):
    return draw(scene, [parse_variation(text) for text in VARY], 12, 3)


@pytest.fixture(scope="package")
def ensemble(scene, inputs):
    return simulate_members(scene, inputs)


@pytest.fixture(scope="package")
def finished(tmp_path_factory):
    """The file of a finished ensemble that one process computed, by the command."""
    folder = tmp_path_factory.mktemp("ensemble") / "run"
    assert main(arguments(folder, processes=1)) == 0
    return folder / "ensemble.h5"
