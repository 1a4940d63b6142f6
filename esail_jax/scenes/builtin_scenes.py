"""The built-in scenes: TOML files in the folder `builtin`. The first line of each is a comment that
describes it."""

from importlib import resources

DIRECTORY = resources.files("esail_jax.scenes") / "builtin"


def builtin_names() -> list[str]:
    """Names of the built-in scenes, sorted."""
    return sorted(
        path.name.removesuffix(".toml") for path in DIRECTORY.iterdir() if path.name.endswith(".toml")
    )


def builtin_text(name: str) -> str | None:
    """TOML text of a built-in scene; None if no scene has this name."""
    path = DIRECTORY / f"{name}.toml"
    return path.read_text(encoding="utf-8") if name in builtin_names() else None


def description(name: str) -> str:
    """Description of a built-in scene: the first line of its file."""
    return builtin_text(name).splitlines()[0].removeprefix("# ")
