"""What a process does with a piece: results that are too large to travel are written by the process."""

import json

import numpy as np
import pytest

from esail_jax.ensembles import work
from esail_jax.ensembles.driver import drive
from esail_jax.ensembles.ensemble_file import computed_members, parts_of
from esail_jax.ensembles.merging import merge_pieces
from esail_jax.ensembles.pieces import Piece, PieceFile, files_in, identity_of, new_path, pieces_of
from esail_jax.ensembles.running import check_draws
from esail_jax.ensembles.task import about, task_of
from esail_jax.errors import SceneError
from support.made_up_engine import MadeUp, piece_of
from support.small_ensemble import VARY, made_up


@pytest.fixture
def task(scene):
    return task_of(scene, 6, VARY, 3, "random", ["coning_angle"])


def work_of(task, members, folder):
    """The piece of some members, as the driver hands it out."""
    inputs = task.draws.of(np.array(members))
    shapes = tuple((key, values.shape[1:]) for key, values in inputs.items())
    program = work.Program(json.dumps(about(task)), shapes, None, ("elsewhere", 1))
    return work.Work(program, 8, np.array(members), inputs, str(parts_of(folder)), "a.token", 0)


@pytest.mark.parametrize(("large", "seen"), [(True, True), (True, False), (False, True)])
def test_large_results_are_written_where_they_were_computed(
    task, scene, tmp_path, monkeypatch, large, seen
):
    """A piece above the limit is written by the process if it sees the folder of this driver, which its
    token shows; otherwise it travels."""
    monkeypatch.setattr(work, "LARGE_BYTES", 0 if large else 2**25)
    monkeypatch.setattr(
        work, "runner_of", lambda *_: lambda members, inputs: made_up(scene, members, inputs)
    )
    parts_of(tmp_path).mkdir()
    if seen:
        (parts_of(tmp_path) / "a.token").touch()
    found = work.compute(work_of(task, [2, 4], tmp_path))
    files = files_in(parts_of(tmp_path))
    if large and seen:
        assert isinstance(found, work.Written) and found.members.tolist() == [2, 4]
        (path,) = files
        (piece,) = pieces_of(path)
        assert identity_of(path) == about(task) and piece.rows["coning_angle"][:, 0, 0].tolist() == [
            2.0,
            4.0,
        ]
        assert np.flatnonzero(computed_members(tmp_path, task)[0]).tolist() == [2, 4]
    else:
        assert isinstance(found, Piece) and not files


def test_pieces_that_processes_have_written(task, tmp_path):
    """The driver takes them as computed, and they are put together with those that travelled."""

    def do(members):
        if members[0] % 2:
            return piece_of(members)
        with PieceFile(new_path(parts_of(tmp_path)), about(task)) as file:
            file.add(piece_of(members))
        return work.Written(members)

    assert drive(task, tmp_path, np.ones(6, bool), MadeUp(do)) == (False, {})
    assert merge_pieces(tmp_path, task) == ("complete", "")
    assert [path.name for path in tmp_path.iterdir()] == ["ensemble.h5"]


def test_a_process_that_comes_too_late_makes_no_folder(task, tmp_path):
    """Once the pieces are put together, a process that was stopped for long finds no folder to write to."""
    with pytest.raises(FileNotFoundError):
        PieceFile(new_path(parts_of(tmp_path)), about(task))
    assert not parts_of(tmp_path).exists()


def test_the_check_of_draws_can_be_interrupted(task):
    """It takes minutes for a million members."""
    check_draws(task, np.arange(6), lambda: False)
    with pytest.raises(KeyboardInterrupt):
        check_draws(task, np.arange(6), lambda: True)


def test_a_refused_draw_is_named_by_its_number(scene):
    """Also where only some members are checked, as those that a command that goes on still lacks."""
    task = task_of(scene, 40, ["initial.spin_rate=uniform:1e-3:2e-3", "hub.density=grid:-1:800:2"])
    check_draws(task, np.array([1, 3, 5]), lambda: False)
    with pytest.raises(SceneError, match=r"`hub.density` must .* \(member 38\)"):
        check_draws(task, np.array([1, 3, 38]), lambda: False)
