"""Run files made by the command, and comparisons bit by bit."""

import h5py
import jax
import numpy as np

from esail_jax import cli


def esail_run(scene, path, *more):
    """Runs `esail run` in this process and returns its exit status."""
    return cli.main(["run", str(scene), "-o", str(path), "--quiet", *map(str, more)])


def status_of(path):
    """The status that a run file records."""
    with h5py.File(path, "r") as file:
        return file.attrs["status"]


def check_same(path, other):
    """Two run files have the same names, shapes and bits in /time, /observables, /numerics and /state."""
    with h5py.File(path, "r") as a, h5py.File(other, "r") as b:
        names = ([], [])
        for file, found in zip((a, b), names, strict=True):
            file.visit(found.append)
        assert names[0] == names[1]
        for name in names[0]:
            if isinstance(a[name], h5py.Dataset) and name != "scene":
                assert a[name].shape == b[name].shape, name
                assert a[name][()].tobytes() == b[name][()].tobytes(), f"{name} differs"
        assert dict(a["state"].attrs) == dict(b["state"].attrs)
        assert (a.attrs["status"], a.attrs["steps"]) == (b.attrs["status"], b.attrs["steps"])


def same_bits(a, b):
    """Whether two trees of arrays have the same structure and bits."""
    leaves = ([np.asarray(x) for x in jax.tree.leaves(tree)] for tree in (a, b))
    pairs = zip(*leaves, strict=True)
    return jax.tree.structure(a) == jax.tree.structure(b) and all(
        (x.dtype, x.shape, x.tobytes()) == (y.dtype, y.shape, y.tobytes()) for x, y in pairs
    )
