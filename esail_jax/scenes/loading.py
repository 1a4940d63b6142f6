"""The door by which a scene comes to be computed."""

import os
from collections.abc import Mapping
from typing import Any

from esail_jax.scenes.merging import check_overrides
from esail_jax.scenes.own_law import check_has_law
from esail_jax.scenes.own_terms import check_has_terms
from esail_jax.scenes.scene import Scene, read_scene
from esail_jax.scenes.size_limits import check_size


def load_scene(source: "str | os.PathLike | Scene", overrides: Mapping[str, Any] | None = None) -> Scene:
    """A built-in scene by name, a TOML file by path, or a `Scene` itself, with overrides by key, which may
    also give what a file lacks. Raises SceneError, also for a scene that this machine cannot compute, and
    for one that names a law in Python but does not have it."""
    if overrides is not None:
        check_overrides("overrides", overrides, "`voltage_law=law`")
    scene = source.replace(overrides or {}) if isinstance(source, Scene) else read_scene(source, overrides)
    check_size(scene)
    if scene.chain is None and scene.voltage is not None:
        check_has_law(scene.voltage.law, scene.voltage_law)
    if scene.terms:
        from esail_jax.scenes.trial_of_terms import try_terms  # imports JAX

        check_has_terms(scene)
        try_terms(scene)
    return scene
