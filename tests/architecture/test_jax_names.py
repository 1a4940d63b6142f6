"""Names of JAX that may change with every release stand in one module, and `kept_programs` stands alone."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
INTERNALS = ROOT / "kept_programs" / "jax_internals.py"
FILES = [
    path
    for package in ("esail_jax", "kept_programs")
    for path in sorted((ROOT / package).rglob("*.py"))
    if path != INTERNALS and "tests" not in path.parts
]

NOT_PUBLIC = re.compile(
    r"(jax\.(_src|interpreters|extend|core|config\.values)|jaxlib)\b|_private_parameters"
)
"""Modules about which JAX promises nothing, and arguments that it calls private."""

TRACER = {"jax.core", "jax.core.Tracer"}
"""The name of `jax.core` that is documented, and its beginning."""


def names_in(path: Path) -> set[str]:
    """The dotted names that a file imports or uses, without those in texts."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
            if node.module == "jax":
                assert not {"core", "interpreters", "extend"} & {alias.name for alias in node.names}, path
        elif isinstance(node, ast.Attribute):
            found.add(ast.unparse(node))
        elif isinstance(node, ast.keyword) and node.arg:
            found.add(node.arg)
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_names_that_are_not_public_stand_in_one_module(path):
    used = {name for name in names_in(path) if NOT_PUBLIC.match(name)}
    assert not {name for name in used if name not in TRACER and not name.startswith("jax.core.Tracer.")}


def test_that_module_is_short_and_has_some_of_them():
    assert len(INTERNALS.read_text(encoding="utf-8").splitlines()) <= 250
    assert any(name.startswith("jax.interpreters") for name in names_in(INTERNALS))


def test_kept_programs_imports_nothing_of_this_package():
    for path in (ROOT / "kept_programs").rglob("*.py"):
        assert not any(name.partition(".")[0] == "esail_jax" for name in names_in(path)), path
