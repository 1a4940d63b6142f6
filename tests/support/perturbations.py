"""The lists of perturbations (`architecture/mutations/*.toml`)."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
LISTS = ROOT / "tests" / "architecture" / "mutations"


def mutations() -> list[dict]:
    """All mutations, each with name, file, old, new and tests (arguments of pytest)."""
    found = []
    for path in sorted(LISTS.glob("*.toml")):
        found += tomllib.loads(path.read_text(encoding="utf-8"))["mutation"]
    return found


def path_of(mutation: dict) -> Path:
    """The path of a mutation's file in the project. In the lists it begins within `esail_jax`, or
    with `kept_programs`."""
    file = mutation["file"]
    return Path(file if file.startswith("kept_programs/") else f"esail_jax/{file}")
