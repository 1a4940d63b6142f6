"""The README: its example prints what it shows, its links lead somewhere, and it is short."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_links_and_pictures_exist():
    links = [link for link in re.findall(r"\]\(([^)#]+)[^)]*\)", README) if "://" not in link]
    assert len(links) > 10
    assert not [link for link in links if not (ROOT / link).exists()]


def test_it_is_short():
    assert len(README.splitlines()) <= 120


@pytest.mark.slow
def test_the_example_prints_what_is_shown(capsys):
    """The numbers are printed with six digits, of which the gradient and the difference quotient share all.
    Times differ from machine to machine, and are not compared."""
    program, shown = re.search(r"```python\n(.*?)```\n\n```text\n(.*?)```", README, re.DOTALL).groups()
    exec(compile(program, "README.md", "exec"), {})

    def without_times(text):
        return re.sub(r"[\d.]+ s, compiling [\d.]+ s", "", text)

    assert without_times(capsys.readouterr().out) == without_times(shown)


def test_the_list_of_experiments_has_every_folder():
    """`experiments/README.md` names every folder of experiments once, and each folder has a README."""
    folder = ROOT / "experiments"
    listed = re.findall(r"\]\((\w+)/README\.md\)", (folder / "README.md").read_text(encoding="utf-8"))
    folders = [path.name for path in folder.iterdir() if path.is_dir() and path.name != "__pycache__"]
    assert sorted(listed) == sorted(folders)
    assert all((folder / name / "README.md").exists() for name in folders)
