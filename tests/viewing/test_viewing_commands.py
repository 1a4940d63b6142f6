"""`esail animate` and `esail view`: what they write, what they refuse, and what they import."""

import pytest

from esail_jax import cli
from esail_jax.files.opening import RunFileError
from esail_jax.files.reading import read_runs
from support.new_process import heavy_imports_of


def refused(arguments, capsys):
    """Runs a command that is refused and returns its one line."""
    status = cli.main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    assert (status, out) == (2, "") and err.count("\n") == 1, err
    return err.strip()


@pytest.mark.parametrize(
    ("command", "name", "options"),
    [("view", "page.html", []), ("animate", "run.gif", ["--seconds", "0.2", "--size", "100x100"])],
)
def test_a_file_that_exists_is_replaced_only_if_asked(command, name, options, sail, tmp_path, capsys):
    path = tmp_path / name
    given = [command, str(sail), "-o", str(path), *options]
    assert cli.main(given) == 0
    assert capsys.readouterr().out == f"{path}\n"
    path.write_text("mine")
    assert refused(given, capsys) == f"`{path}` must not exist (or ask for --overwrite), but does"
    assert path.read_text() == "mine"
    assert cli.main([*given, "--overwrite"]) == 0 and path.stat().st_size > 1000


REFUSED = [
    ("view", "page.png", [], "`-o` must end in .html or .htm, but ends in '.png'"),
    ("animate", "run.avi", [], "`-o` must end in .webp, .gif or .mp4, but ends in '.avi'"),
    ("animate", "run.gif", ["--fps", "0"], "`--fps` must be positive and finite, but is 0"),
    ("animate", "run.gif", ["--seconds", "inf"], "`--seconds` must be positive and finite, but is inf"),
    ("animate", "run.gif", ["--size", "12"],
     "`--size` must be width and height in pixels, each 64 to 4096, but is '12'"),
    ("view", "page.html", ["--exaggeration", "-2"],
     "`--exaggeration` must be positive and finite, but is -2"),
    ("view", "page.html", ["--member", "0"],
     "`--member` must be left out with a file of one run, but is 0"),
]  # fmt: skip


@pytest.mark.parametrize(("command", "name", "options", "line"), REFUSED, ids=lambda x: str(x)[:30])
def test_options_out_of_range_are_refused(command, name, options, line, sail, tmp_path, capsys):
    assert refused([command, sail, "-o", tmp_path / name, *options], capsys) == line
    assert not list(tmp_path.iterdir())


def test_what_a_chain_has_not_is_refused(sail, chain, tmp_path, capsys):
    page = tmp_path / "page.html"
    line = refused(["view", chain, "-o", page, "--axes", "spinning"], capsys)
    assert line == "`--axes` must be left out with a chain, but is 'spinning'"
    line = refused(["view", chain, "-o", page, "--colour", "voltage"], capsys)
    assert line == "`--colour` must be one of tension, strain, none here, but is 'voltage'"
    line = refused(["view", chain, sail, "-o", page], capsys)
    assert line == "`RUN.h5` must be of sails or of chains, but there are both"
    assert not page.exists()


def test_members_of_an_ensemble(ensemble, tmp_path, capsys):
    """A page shows one member or several, an animation one."""
    page, movie = tmp_path / "page.html", tmp_path / "run.gif"
    two = ["--member", "0", "--member", "2"]
    assert cli.main(["view", str(ensemble), "-o", str(page), *two]) == 0
    capsys.readouterr()
    assert "ensemble.h5, member 0" in page.read_text() and "ensemble.h5, member 2" in page.read_text()
    assert refused(["animate", ensemble, "-o", movie, *two], capsys).startswith(
        "`--member` must be given once"
    )
    line = refused(["animate", ensemble, "-o", movie], capsys)
    assert line == "`--member` must be given with an ensemble (0 to 2), but is not"
    for member in (-1, 3):
        with pytest.raises(RunFileError, match=f"must be between 0 and 2, but is {member}"):
            read_runs(ensemble, (member,))


@pytest.mark.parametrize(
    ("command", "name", "heavy"),
    [("view", "page.html", set()), ("animate", "run.gif", {"matplotlib"})],
)
def test_showing_a_run_imports_no_jax(command, name, heavy, sail, tmp_path):
    status, found = heavy_imports_of([command, str(sail), "-o", str(tmp_path / name)])
    assert status == 0 and set(found) <= heavy
