"""The driver of an ensemble: what it does with pieces that executors lose, refuse or never give back."""

import pickle
import threading
import time
from collections import Counter
from concurrent.futures import Future

import h5py
import numpy as np
import pytest

from esail_jax.ensembles import driver
from esail_jax.ensembles.driver import ATTEMPTS, drive
from esail_jax.ensembles.ensemble_file import computed_members, parts_of
from esail_jax.ensembles.merging import merge_pieces
from esail_jax.ensembles.pieces import files_in, pieces_of
from esail_jax.ensembles.task import task_of
from esail_jax.errors import NoSpaceError, SceneError
from support.made_up_engine import MadeUp, Never, died, piece_of
from support.small_ensemble import VARY

EVERYONE = np.ones(12, bool)


@pytest.fixture(scope="module")
def task(scene):
    return task_of(scene, 12, VARY, 3, "random", ["coning_angle"])


def found_in(folder, task):
    """The coning angle [rad] of every member in the pieces, and whether it is computed."""
    angle = np.full(task.count, np.nan)
    for path in files_in(parts_of(folder)):
        for piece in pieces_of(path):
            angle[piece.members] = piece.rows["coning_angle"][:, 0, 0]
    return angle


def test_every_member_once(task, tmp_path):
    """All pieces are computed, in pieces of the batch at most, and written."""
    told = []
    ended = drive(task, tmp_path, EVERYONE, MadeUp(), show=told.append)
    assert ended == (False, {}) and told[-1] == 12
    assert found_in(tmp_path, task).tolist() == list(range(12))
    assert merge_pieces(tmp_path, task) == ("complete", "")
    with h5py.File(tmp_path / "ensemble.h5") as file:  # twelve pieces of 0.5 s and 1 s, and the program
        assert (file.attrs["compile_time"], file.attrs["wall_time"]) == (12 * 0.5 + 0.25, 12.0)


def test_only_what_is_missing(task, tmp_path):
    """Of members that are computed nothing is handed out."""
    missing = EVERYONE.copy()
    missing[[2, 5]] = False
    engine = MadeUp()
    drive(task, tmp_path, missing, engine)
    assert sorted(np.concatenate(engine.asked).tolist()) == [0, 1, 3, 4, 6, 7, 8, 9, 10, 11]
    assert not computed_members(tmp_path, task)[0][[2, 5]].any()


def test_pieces_are_as_large_as_the_program_and_the_number_of_members_allow(task, tmp_path, monkeypatch):
    """A piece has a batch of members, fewer if there would be too few pieces. Members side by side in one
    program are always a full batch."""
    for least, lockstep, sizes in ((256, False, [1] * 12), (3, False, [4, 4, 4]), (256, True, [5, 5, 2])):
        monkeypatch.setattr(driver, "LEAST_PIECES", least)
        engine = MadeUp(prepared=lambda lockstep=lockstep: driver.Prepared(5, lockstep, 0.25))
        drive(task, tmp_path / f"{least} {lockstep}", EVERYONE, engine)
        assert [len(members) for members in engine.asked] == sizes


def test_the_first_task_is_alone(task, tmp_path):
    """Nothing is handed out until one process has prepared the program: the others find it compiled."""
    order, free = [], threading.Event()

    def prepared():
        time.sleep(0.3)
        order.append("prepared")
        free.set()
        return driver.Prepared(1, False, 0.25)

    def do(members):
        assert free.is_set()
        order.append("piece")
        return piece_of(members)

    drive(task, tmp_path, EVERYONE, MadeUp(do, prepared=prepared))
    assert order == ["prepared"] + ["piece"] * 12


def test_a_process_that_dies(task, tmp_path, monkeypatch):
    """Its piece is taken apart and computed by others; nobody is lost."""
    monkeypatch.setattr(driver, "LEAST_PIECES", 3)
    deaths = Counter()

    def do(members):
        if 5 in members and not deaths[5]:
            deaths[5] += 1
            raise died()
        return piece_of(members)

    engine = MadeUp(do, batch=4)
    assert drive(task, tmp_path, EVERYONE, engine) == (False, {})
    assert found_in(tmp_path, task).tolist() == list(range(12))
    assert [4, 5, 6, 7] in engine.asked and all([m] in engine.asked for m in (4, 5, 6, 7))


def test_an_attempt_differs_from_the_one_before(task, tmp_path):
    """Dask does not compute again what it is asked for in the same words: neither another attempt, nor the
    same piece of a command that goes on."""
    asked = []

    class Asked(MadeUp):
        def submit(self, function, /, *arguments):
            asked.append(pickle.dumps((function, arguments)))
            return super().submit(function, *arguments)

    def do(members):
        raise died()

    for _ in range(2):
        drive(task, tmp_path, EVERYONE, Asked(do))
    assert len(asked) == 2 * (1 + 12 * ATTEMPTS) and len(set(asked)) == len(asked)


def test_a_member_that_kills_every_process(task, tmp_path, monkeypatch):
    """It is missing after four attempts, with the reason; the members that were with it are computed."""
    monkeypatch.setattr(driver, "LEAST_PIECES", 3)

    def do(members):
        if 5 in members:
            raise died()
        return piece_of(members)

    engine = MadeUp(do, batch=4)
    ended = drive(task, tmp_path, EVERYONE, engine)
    assert ended == (False, {"WorkerDiedError: a process ended by signal 9": [5]})
    angle = found_in(tmp_path, task)
    assert np.isnan(angle[5]) and np.isfinite(np.delete(angle, 5)).all()
    assert engine.asked.count([5]) == ATTEMPTS - 1
    assert merge_pieces(tmp_path, task) == ("interrupted", "1 of 12 members are missing (5)")


def test_a_member_that_raises(task, tmp_path):
    """An error of Python is treated as a death, and its first line is the reason."""

    def do(members):
        if members[0] in (3, 9):
            raise MemoryError("no room\nfor more")
        return piece_of(members)

    assert drive(task, tmp_path, EVERYONE, MadeUp(do)) == (False, {"MemoryError: no room": [3, 9]})


def test_a_function_of_a_user_that_does_not_fit(task, tmp_path):
    """Bad input ends the ensemble at once, as one line; nothing else is handed out again and again."""

    def do(members):
        raise SceneError("reduce own:mean", "return the shape (3,)", "returns ()")

    engine = MadeUp(do)
    with pytest.raises(SceneError, match=r"^`reduce own:mean` must return the shape \(3,\)"):
        drive(task, tmp_path, EVERYONE, engine)
    assert len(engine.asked) == 12


def test_a_full_disk(task, tmp_path, monkeypatch):
    """The ensemble ends; the pieces before stay, and no part of the last one."""
    add = driver.PieceFile.add

    def full(file, piece):
        if piece.members[0] == 4:
            raise NoSpaceError("no space is left")
        add(file, piece)

    monkeypatch.setattr(driver.PieceFile, "add", full)
    with pytest.raises(NoSpaceError):
        drive(task, tmp_path, EVERYONE, MadeUp())
    assert 0 < np.isfinite(found_in(tmp_path, task)).sum() < 12
    assert not list(parts_of(tmp_path).glob("*.token"))


def test_preparing_fails_again_and_again(task, tmp_path):
    """If the program cannot be prepared in four attempts, nothing is computed, and the reason is told."""
    tries = []

    def prepared():
        tries.append(1)
        raise died()

    ended = drive(task, tmp_path, EVERYONE, MadeUp(prepared=prepared))
    assert ended == (False, {"WorkerDiedError: a process ended by signal 9": []}) and len(tries) == ATTEMPTS


def test_preparing_fails_once(task, tmp_path):
    """Another process prepares the program then."""
    tries = []

    def prepared():
        tries.append(1)
        if len(tries) == 1:
            raise died()
        return driver.Prepared(1, False, 0.25)

    assert drive(task, tmp_path, EVERYONE, MadeUp(prepared=prepared)) == (False, {})
    assert np.isfinite(found_in(tmp_path, task)).all()


def test_an_executor_that_takes_nothing_at_all(task, tmp_path):
    """Nothing is written then."""
    engine = Never()
    engine.submit = lambda *_: (_ for _ in ()).throw(RuntimeError("cannot schedule new futures"))
    with pytest.raises(SceneError, match=r"^`executor` must take work"):
        drive(task, tmp_path, EVERYONE, engine)
    assert not list(tmp_path.iterdir())


def test_an_executor_that_takes_nothing_more(task, tmp_path):
    """What it has computed until then is written, and the reason is told."""
    engine = MadeUp()
    submit = engine.submit

    def broken(function, /, *arguments):
        if len(engine.asked) == 5:
            raise RuntimeError("cannot schedule new futures after shutdown")
        return submit(function, *arguments)

    engine.submit = broken
    at_work, reasons = drive(task, tmp_path, EVERYONE, engine)
    assert list(reasons) == ["the executor takes nothing more: cannot schedule new futures after shutdown"]
    assert not at_work and np.isfinite(found_in(tmp_path, task)).sum() <= 5


def test_interrupted(task, tmp_path, monkeypatch):
    """What has not begun is cancelled; a piece that is at work gets its time, and is given up after it."""
    monkeypatch.setattr(driver, "GRACE_SECONDS", 0.3)
    engine, asked = Never(), threading.Event()
    threading.Timer(0.3, asked.set).start()
    ended = drive(task, tmp_path, EVERYONE, engine, stop=asked.is_set)
    assert ended == (True, {}) and not np.isfinite(found_in(tmp_path, task)).any()
    assert [future.cancelled() for future in engine.futures] == [False] + [True] * 11


def test_interrupted_pieces_that_end_in_time_are_kept(task, tmp_path):
    """A piece that was at work when the signal came is written."""
    asked = threading.Event()

    def do(members):
        if members[0] == 3:
            asked.set()
        if members[0] >= 3:
            time.sleep(0.5)
        return piece_of(members)

    ended = drive(task, tmp_path, EVERYONE, MadeUp(do), stop=asked.is_set)
    angle = found_in(tmp_path, task)
    assert ended == (False, {}) and angle[3] == 3.0 and np.isnan(angle[8:]).any()


def test_interrupted_while_the_program_is_prepared(task, tmp_path, monkeypatch):
    """Compiling cannot be stopped; it is given up after its time."""
    monkeypatch.setattr(driver, "GRACE_SECONDS", 0.2)
    hold = threading.Event()
    ended = drive(task, tmp_path, EVERYONE, MadeUp(prepared=hold.wait), stop=lambda: True)
    hold.set()
    assert ended == (True, {})


def test_few_pieces_are_with_the_executor(task, tmp_path, monkeypatch):
    """Pieces are handed out as others come back: the memory does not grow with the number of members."""
    monkeypatch.setattr(driver, "IN_FLIGHT", 2)
    now, most = Counter(), []

    def do(members):
        return piece_of(members)

    engine = MadeUp(do)
    submit = engine.submit

    def counted(function, /, *arguments) -> Future:
        now["there"] += 1
        most.append(now["there"])
        future = submit(function, *arguments)
        future.add_done_callback(lambda _: now.subtract(["there"]))
        return future

    engine.submit = counted
    drive(task, tmp_path, EVERYONE, engine)
    assert max(most) <= 2 and np.isfinite(found_in(tmp_path, task)).all()
