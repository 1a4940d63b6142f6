"""Every notebook runs from its first to its last cell and shows a picture. The default tests check only the
form of notebooks."""

import re
from pathlib import Path

import nbclient
import nbformat
import pytest

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
COURSE = (ROOT / "docs" / "course.md").read_text(encoding="utf-8")

SOLUTIONS = (ROOT / "docs" / "course_solutions.md").read_text(encoding="utf-8")

SECONDS_PER_CELL = 300

LONG = ["06_an_ensemble"]
"""Notebooks in which running takes longer than compiling. They are compiled with the package's options."""

WITH_SOLUTIONS = ["01_first_sail", "04_reading_a_run"]
"""Notebooks whose solutions run with them, in a second: they compile nothing. Those of the others would
take ten minutes."""


def solutions_of(path):
    """The solutions of a notebook's exercises: number, code and answer of each."""
    section = re.split(r"^## ", SOLUTIONS.partition(f"## {path.stem[:2]} ")[2], flags=re.M)[0]
    block = r"^:::\{dropdown\} (\d)\. [^\n]*\n```\{code-block\} python\n(.*?)^```\n(.*?)^:::$"
    return re.findall(block, section, flags=re.M | re.S)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_exercise_has_a_solution(path):
    """A solution has the number of its exercise, code that is Python, and an answer in words."""
    last = nbformat.read(path, as_version=4).cells[-1].source
    exercises = re.findall(r"^(\d)\. ", last.partition("## Exercises")[2], flags=re.M)
    solutions = solutions_of(path)
    assert exercises and [number for number, _, _ in solutions] == exercises
    for number, code, answer in solutions:
        compile(code, f"{path.stem}, {number}", "exec")
        assert len(answer.split()) > 5


@pytest.mark.nightly
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path, tmp_path, monkeypatch):
    if path.stem in LONG:
        monkeypatch.delenv("XLA_FLAGS", raising=False)
    notebook = nbformat.read(path, as_version=4)
    if path.stem in WITH_SOLUTIONS:
        notebook.cells += [nbformat.v4.new_code_cell(code) for _, code, _ in solutions_of(path)]
    client = nbclient.NotebookClient(
        notebook,
        kernel_name="python3",
        timeout=SECONDS_PER_CELL,
        resources={"metadata": {"path": str(tmp_path)}},  # notebooks write their files there
    )
    client.execute()  # raises CellExecutionError, which shows the cell and its traceback
    outputs = [output.get("data", {}) for cell in notebook.cells for output in cell.get("outputs", [])]
    assert any("image/png" in data for data in outputs)
    # Without an inline backend, IPython shows a figure as the text "<Figure size ...>".
    figures = [data for data in outputs if data.get("text/plain", "").startswith("<Figure")]
    assert all("image/png" in data for data in figures)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_stored_without_outputs(path):
    cells = nbformat.read(path, as_version=4).cells
    assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_starts_from_a_question(path):
    """The course page of the site has the question, too, and the notebook to download."""
    title, question, *_ = nbformat.read(path, as_version=4).cells[0].source.split("\n\n")
    assert title.startswith("# ") and question.startswith("*Question.* ") and "?" in question
    assert COURSE.count(f"(generated/notebooks/{path.stem})") == 1
    assert COURSE.count(f"<generated/downloads/{path.name}>") == 1


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_ends_with_two_exercises(path):
    last = nbformat.read(path, as_version=4).cells[-1]
    _, heading, exercises = last.source.partition("## Exercises\n")
    numbers = [line[:3] for line in exercises.splitlines() if line[:1].isdigit()]
    assert last.cell_type == "markdown" and heading and numbers == ["1. ", "2. "]


def test_notebooks_are_numbered_without_gaps():
    # Also, an empty folder would pass the other tests.
    numbers = [int(path.name[:2]) for path in NOTEBOOKS]
    assert numbers == list(range(1, len(numbers) + 1)) and numbers
