"""What a user may have meant by a keyword that a function of the package does not have."""

from collections.abc import Iterable

from esail_jax.scenes.key_reference import describe_keys


def refuse_keywords(function: str, unknown: Iterable[str]) -> None:
    """Raises TypeError for the first keyword that is no argument of a function of a scene. Values of a
    scene's keys go by their whole names in `overrides`: the message shows those that end in the keyword."""
    for name in unknown:
        keys = dict.fromkeys(key.key for key in describe_keys() if key.name == name)
        shown = " or ".join(f'{{"{key}": ...}}' for key in keys) or '{"integrator.t_end": 100.0}'
        raise TypeError(
            f"`{function}` has no argument `{name}`: values of scene keys are given by key, as in "
            f"{function}(scene, {shown})"
        )
