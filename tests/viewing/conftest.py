"""Files of invented runs."""

import numpy as np
import pytest

from esail_jax.scenes.loading import load_scene
from esail_jax.viewing.motions import read_motions
from esail_jax.viewing.page import page_of
from support.motion_files import TIME, chain_rows, sail_rows, sail_scene, write_run


@pytest.fixture(scope="package")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="package")
def sail(folder):
    """The file of a sail."""
    return write_run(folder / "sail.h5", sail_scene(), TIME, sail_rows())


@pytest.fixture(scope="package")
def chain(folder):
    """The file of a chain."""
    time = np.linspace(0.0, 5.0, 41)
    return write_run(folder / "chain.h5", load_scene("hanging-chain"), time, chain_rows())


@pytest.fixture(scope="package")
def ensemble(folder):
    """The file of an ensemble of three sails."""
    return write_run(folder / "ensemble.h5", sail_scene(), TIME, sail_rows(), members=3)


@pytest.fixture(scope="package")
def page(sail):
    """The text of the page of the sail."""
    return page_of(read_motions([sail], (), 1000))
