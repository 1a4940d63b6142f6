"""Positions of all nodes, which are saved on request only."""

import numpy as np
import pytest

import esail_jax as esail
from esail_jax import cli
from esail_jax.commands.running import NODES, names_with
from esail_jax.viewing.motions import read_motions

pytestmark = pytest.mark.nightly


@pytest.fixture(scope="module")
def run(small):
    """A run that saves what `--nodes` saves: the command then needs no program of its own."""
    return esail.simulate("baseline", small, save=names_with(esail.load_scene("baseline", small), (NODES,)))


def test_nodes_lead_from_the_hub_to_the_tips(run):
    """The last node is the tip. The first lies on the hub, at its radius of 1 m, in its mid-plane.
    The chords between the nodes are at most as long as the tether: shorter by its curvature, a part of
    1e-6 in a run that starts straight."""
    nodes = np.asarray(run["node_position_I"])
    assert nodes.shape == (len(run.time), 3, 3, 3)
    assert np.array_equal(nodes[:, :, -1], run["tip_position_I"])
    roots = nodes[:, :, 0] - np.asarray(run["hub_position_I"])[:, None]
    assert np.abs(np.linalg.norm(roots, axis=-1) - 1.0).max() < 1e-9
    assert np.abs(np.einsum("tni,ti->tn", roots, np.asarray(run["rotation_IB"])[..., 0])).max() < 1e-9
    chords = np.linalg.norm(np.diff(nodes, axis=2), axis=-1).sum(-1)
    shortening = 1.0 - chords / np.asarray(run["tether_length"])
    assert -1e-12 < shortening.min() and shortening.max() < 1e-6


def test_a_run_has_them_on_request_only(run, small, tmp_path):
    """They go to a file and back, and a moving picture of the file is drawn through them."""
    assert "node_position_I" not in esail.simulate("baseline", small).observables
    esail.save(run, tmp_path / "run.h5")
    assert np.array_equal(esail.load(tmp_path / "run.h5")["node_position_I"], run["node_position_I"])
    (motion,) = read_motions([tmp_path / "run.h5"], (), 1000)
    assert "nodes" in motion.shape
    drawn = np.einsum("tib,tvb->tvi", motion.rotation, motion.vertices)
    drawn += np.asarray(run["hub_position_I"])[:, None]
    nodes = np.asarray(run["node_position_I"]).reshape(drawn.shape)
    assert np.abs(drawn - nodes).max() < 1e-8, "rounding of rotations of ten kilometres"


def test_a_command_saves_them_and_goes_on_with_them(small, tmp_path, capsys):
    """`--resume` finds in the file whether nodes are saved. A file without them cannot get them later."""
    settings = [x for key, value in small.items() for x in ("--set", f"{key}={value}")]

    def run(name, *more):
        return cli.main(["run", "baseline", *settings, "-o", str(tmp_path / name), "--quiet", *more])

    assert run("whole.h5", "--nodes") == 0
    assert run("parts.h5", "--nodes", "--t-end", "10") == 0
    assert run("parts.h5", "--resume") == 0
    whole, parts = (esail.load(tmp_path / name) for name in ("whole.h5", "parts.h5"))
    assert "coning_angle" in whole and np.array_equal(whole["node_position_I"], parts["node_position_I"])
    assert run("without.h5", "--t-end", "10") == 0
    assert run("without.h5", "--nodes", "--resume") == 2
    assert capsys.readouterr().err.startswith("`--nodes` must be left out")
    assert run("without.h5", "--resume") == 0
    assert run("without.h5", "--nodes", "--resume") == 2, "also when nothing is left to do"
    assert capsys.readouterr().err.startswith("`--nodes` must be left out")
    assert cli.main(["run", "hanging-chain", "-o", str(tmp_path / "chain.h5"), "--nodes"]) == 2
    assert capsys.readouterr().err.startswith("`--nodes` must be left out with a chain")
