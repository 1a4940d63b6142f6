"""Ensembles that were computed one by one, with seeds of their own, are one sample."""

import numpy as np
import pytest

import esail_jax as esail
from esail_jax.cli import main
from esail_jax.ensembles import draw, join, load_ensemble, outcomes_of
from esail_jax.ensembles.merging import merge_pieces
from esail_jax.ensembles.task import task_of
from esail_jax.errors import InputError
from support.made_up_engine import piece_of, write_pieces
from support.small_ensemble import SMALL, made_up

VARY = ("initial.spin_rate=uniform:3.9e-3:4.1e-3",)


@pytest.fixture(scope="module")
def folders(scene, tmp_path_factory):
    """The folders of two ensembles of 12 members, with results that are made up."""
    folder = tmp_path_factory.mktemp("parts")
    for seed in (1, 2):
        path = folder / f"many-{seed}"
        task = task_of(scene, 12, VARY, seed, "random", ["coning_angle"])
        write_pieces(path, task, piece_of(range(12)))
        merge_pieces(path, task)
    return sorted(folder.iterdir())


def test_two_ensembles_are_one_sample(folders):
    """The members are numbered anew, and their inputs and results stay together."""
    parts = [load_ensemble(folder / "ensemble.h5") for folder in folders]
    whole = join(parts)
    assert whole.members.tolist() == list(range(24)) and len(whole) == 24
    for first, part in zip((0, 12), parts, strict=True):
        rows = slice(first, first + 12)
        assert np.array_equal(whole["coning_angle"][rows], part["coning_angle"])
        assert np.array_equal(whole.inputs["initial.spin_rate"][rows], part.inputs["initial.spin_rate"])
    (outcome,) = outcomes_of(whole)
    assert outcome.of(whole).mean() == pytest.approx(np.degrees(5.5), rel=1e-14)


def test_ensembles_that_do_not_fit_are_refused(scene):
    """Members that are the same would count twice; other scenes and keys give another sample."""
    first, second = (made_up(scene, range(4), draw(scene, VARY, 4, seed)) for seed in (1, 2))
    assert len(join([first, second])) == 8
    with pytest.raises(InputError, match="one ensemble at least must be given, but there is none"):
        join([])
    with pytest.raises(InputError, match="the members of part 3 must be new, but an earlier part has the"):
        join([first, second, second])
    other = esail.load_scene("baseline", SMALL | {"tethers.count": 4})
    with pytest.raises(InputError, match="part 2 must have the scene of part 1, but has others"):
        join([first, made_up(other, range(4), second.inputs)])
    with pytest.raises(InputError, match="part 2 must have the varied keys of part 1, but has others"):
        join([first, made_up(scene, range(4), {})])


def test_commands_take_several_folders(folders, tmp_path, capsys):
    """`esail info` and `esail plot` show one sample, of folders or of their files. A run among them is
    refused, and so is a folder without an ensemble."""
    names = [str(folder) for folder in folders]
    assert main(["info", names[0], str(folders[1] / "ensemble.h5")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[1:] for line in lines[:2]] == [["12", "members,", "12", "complete"]] * 2
    assert lines[2] == "One sample of 24 members, 24 complete:"
    assert lines[4].split()[:4] == ["largest", "coning", "angle", "[deg]"]
    assert main(["plot", *names, "-o", str(tmp_path / "figures")]) == 0
    assert "fans.png" in capsys.readouterr().out
    assert main(["plot", names[0], "-o", str(tmp_path / "figures")]) == 0
    assert main(["info", names[0], names[0]]) == 2
    assert "must be new" in capsys.readouterr().err
    for command in (["info", names[0]], ["plot", "-o", str(tmp_path / "figures")]):
        assert main([*command, str(tmp_path)]) == 2
        error = f"`{tmp_path}` must be a run file, but is a folder without an ensemble.h5\n"
        assert capsys.readouterr().err == error


def test_a_file_that_was_cut_off_is_called_damaged(folders, tmp_path, capsys):
    """A copy of the file of an ensemble that ended early."""
    path = tmp_path / "cut.h5"
    path.write_bytes((folders[0] / "ensemble.h5").read_bytes()[:-100])
    assert main(["info", str(path)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"`{path}` must be an intact run file, but is damaged (")
    assert "truncated" in error and error.count("\n") == 1


@pytest.mark.parametrize("command", ["plot", "ensemble", "design"])
def test_a_folder_that_cannot_be_made_is_named(folders, command, tmp_path, capsys):
    """An output below a file, where no folder can be: one line."""
    (tmp_path / "file").write_text("")
    output = tmp_path / "file" / "folder"
    more = ["--members", "2"] if command == "ensemble" else []
    subject = str(folders[0]) if command == "plot" else "baseline"
    assert main([command, subject, "-o", str(output), *more]) == 2
    error = f"`{output}` must be accessible, but is not: Not a directory\n"
    if command == "design":  # before its first run, which takes longest
        error = f"`-o` must be in a writable directory, but {output.parent} is not\n"
    assert error in capsys.readouterr().err
