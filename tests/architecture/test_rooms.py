"""Test modules do not depend on each other or on experiments."""

import ast
from pathlib import Path

TESTS = Path(__file__).parents[1]
FILES = sorted(path.relative_to(TESTS).as_posix() for path in TESTS.rglob("*.py"))


def imported(path: Path) -> set[str]:
    """The parts of all dotted names that a file imports."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {part for alias in node.names for part in alias.name.split(".")}
        elif isinstance(node, ast.ImportFrom):
            names |= {*(node.module or "").split("."), *(alias.name for alias in node.names)}
    return names


def test_no_module_imports_a_test_or_an_experiment():
    """Helpers that several tests share are in `support/`."""
    for name in FILES:
        found = imported(TESTS / name)
        assert "experiments" not in found, name
        assert not {part for part in found if part.startswith("test_")}, name


def test_docstrings_name_what_is_returned():
    """A docstring says what a function returns, "The momentum [kg m/s].", or what it does, "Checks that
    ...". Examples are indented: the site takes the fences of Markdown for a mistake. Style is held by ruff;
    this is what ruff cannot know."""
    root = TESTS.parent
    for folder in ("esail_jax", "kept_programs", "tests", "docs", "experiments"):
        for path in (root / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.AsyncFunctionDef):
                    text = ast.get_docstring(node) or ""
                    assert text.split()[:1] not in (["Returns"], ["Return"]), f"{path}: {node.name}"
                    assert "```" not in text, f"{path}: {node.name}"


def test_names_of_test_modules_are_unique():
    """Pytest imports test modules by their file names alone."""
    names = [Path(name).name for name in FILES if Path(name).name.startswith("test_")]
    assert len(set(names)) == len(names)
