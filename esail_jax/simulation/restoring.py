"""A motion as arrays by path, which a run file holds, and the motion that is restored from them."""

from collections.abc import Mapping
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

T = TypeVar("T")


def paths(tree: Any) -> dict[str, Any]:
    """The leaves of a tree by their path."""
    leaves = jax.tree_util.tree_leaves_with_path(tree)
    return {
        "/".join(str(getattr(key, "name", getattr(key, "idx", key))) for key in path): x
        for path, x in leaves
    }


def restored(like: T, arrays: Mapping[str, np.ndarray]) -> T:
    """A tree such as a motion from arrays by path. Raises ValueError unless they have the names,
    shapes and types of `like`."""
    expected = paths(like)
    for name in expected.keys() | arrays.keys():
        if name not in expected or name not in arrays:
            raise ValueError(f"{name} is {'missing' if name in expected else 'unknown'}")
        kind = (np.shape(expected[name]), jnp.result_type(expected[name]))
        held = (np.shape(arrays[name]), jnp.result_type(arrays[name]))
        if kind != held:
            raise ValueError(f"{name} is {held[1]}{list(held[0])}, not {kind[1]}{list(kind[0])}")
    return jax.tree.unflatten(jax.tree.structure(like), [arrays[name] for name in expected])
