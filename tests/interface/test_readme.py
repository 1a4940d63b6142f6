"""The README: its example prints what it shows, its links lead somewhere, and it is short."""

import re
from itertools import pairwise
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


def test_commands_under_pictures_are_those_of_the_gallery():
    """A picture that both pages show has the same commands below it on both."""
    gallery = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    cards = re.findall(r"!\[[^\]]*\]\(([^)]+)\).*?```shell\n(.*?)```", gallery, re.DOTALL)
    below = {
        Path(picture).name: [" ".join(line.split()) for line in code.replace("\\\n", " ").splitlines()]
        for picture, code in cards
    }
    cells = re.findall(r"!\[[^\]]*\]\(([^)]+)\)(.*?)(?=!\[|\n\n)", README.partition("| | |")[2], re.DOTALL)
    assert len(cells) == 6
    for picture, text in cells:
        assert re.findall(r"`([^`]+)`", text) == below[Path(picture).name], picture


@pytest.mark.parametrize("name", ["start", "gallery"])
def test_commands_read_files_that_commands_before_them_wrote(name):
    page = (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8")
    code = "".join(re.findall(r"^```shell\n(.*?)^```", page, re.DOTALL | re.MULTILINE))
    written = set()
    for line in code.replace("\\\n", " ").splitlines():
        words = line.partition("#")[0].split()
        outputs = {after for word, after in pairwise(words) if word == "-o"}
        assert {word for word in words if word.endswith((".h5", ".toml"))} <= written | outputs, line
        written |= outputs
    assert written


@pytest.mark.nightly
def test_the_example_prints_what_is_shown(capsys):
    """The numbers are printed with six digits, of which the gradient and the difference quotient share all.
    Times differ from machine to machine, and are not compared."""
    program, shown = re.search(r"```python\n(.*?)```\n\n```text\n(.*?)```", README, re.DOTALL).groups()
    exec(compile(program, "README.md", "exec"), {})

    def without_times(text):
        return re.sub(r"[\d.]+ s, compiling [\d.]+ s", "", text)

    assert without_times(capsys.readouterr().out) == without_times(shown)


def test_every_experiment_is_listed():
    """The table in `experiments/README.md` has one row for every folder: question, command, duration. A
    command names a script that exists."""
    table = (ROOT / "experiments" / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| \[(\w+)\]\((\w+)/README\.md\) \| (.+) \| (.+) \| (.+) \|$", table, re.MULTILINE)
    folders = [path.name for path in (ROOT / "experiments").iterdir() if (path / "README.md").exists()]
    assert sorted(name for name, *_ in rows) == sorted(folders)
    for name, link, question, command, duration in rows:
        assert name == link and duration and (name == "pgv_common" or question.endswith("?")), name
        script = re.search(r"`(?:python|sh) ([\w/.]+)", command)
        assert (ROOT / script[1]).exists() if script else command == "-", name
