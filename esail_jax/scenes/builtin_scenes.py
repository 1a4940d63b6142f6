"""The built-in scenes: TOML files beside this one, first line a comment that describes them."""

from importlib import resources

DIRECTORY = resources.files("esail_jax.scenes") / "builtin"


def builtin_names() -> list[str]:
    """Names of the built-in scenes, in the order they are listed."""
    return sorted(
        path.name.removesuffix(".toml") for path in DIRECTORY.iterdir() if path.name.endswith(".toml")
    )


def builtin_text(name: str) -> str | None:
    """TOML text of a built-in scene, None if there is none of that name."""
    path = DIRECTORY / f"{name}.toml"
    return path.read_text(encoding="utf-8") if name in builtin_names() else None


def description(name: str) -> str:
    """First line of the scene's file."""
    return builtin_text(name).splitlines()[0].removeprefix("# ")
