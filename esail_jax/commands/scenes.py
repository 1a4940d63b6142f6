"""`esail scenes`."""

from esail_jax.scenes.loading import builtin_names, description


def list_scenes() -> None:
    """Prints every built-in scene with its description."""
    for name in builtin_names():
        print(f"{name:18s} {description(name)}")
