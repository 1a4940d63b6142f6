"""A motion that is restored from a file has the names, shapes and types that the run expects."""

from typing import NamedTuple

import jax
import numpy as np
import pytest

from esail_jax.simulation.restoring import paths, restored


class Pair(NamedTuple):
    """A tree with names."""

    position: np.ndarray
    count: np.ndarray


LIKE = Pair(np.zeros((3, 2)), np.zeros((), int))


def test_a_tree_comes_back_from_its_paths():
    tree = Pair(np.arange(6.0).reshape(3, 2), np.array(7))
    again = restored(LIKE, paths(tree))
    assert type(again) is Pair and all(jax.tree.map(np.array_equal, tree, again))


@pytest.mark.parametrize(
    "arrays, message",
    [
        ({"position": np.zeros((3, 2))}, "count is missing"),
        ({"position": np.zeros((3, 2)), "count": np.array(1), "rate": np.zeros(())}, "rate is unknown"),
        (
            {"position": np.zeros((2, 3)), "count": np.array(1)},
            r"position is float64\[2, 3\], not float64\[3, 2\]",
        ),
        ({"position": np.zeros((3, 2)), "count": np.array(1.0)}, r"count is float64\[\], not int64\[\]"),
        ({"position": np.zeros((3, 2), np.float32), "count": np.array(1)}, r"position is float32"),
    ],
)
def test_other_names_shapes_and_types_are_refused(arrays, message):
    with pytest.raises(ValueError, match=message):
        restored(LIKE, arrays)
