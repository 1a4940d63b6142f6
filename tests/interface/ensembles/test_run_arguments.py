"""Arguments of `run_ensemble` that are wrong: one line, before anything is computed or written."""

import inspect
import json
import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest

from esail_jax.ensembles import MemberRunner, run_ensemble, running, sampling, task, work
from esail_jax.errors import InputError
from support.made_up_engine import MadeUp
from support.small_ensemble import VARY

RUN = inspect.unwrap(run_ensemble)
"""Without the check of types in the tests, which users do not have."""


@pytest.fixture(autouse=True)
def as_users_call(monkeypatch):
    """Leaves out the checks of types of the functions below, too."""
    for module, names in (
        (running, ("task_of",)),
        (task, ("draws_of",)),
        (sampling, ("variations_of", "check_numbers", "as_distribution")),
    ):
        for name in names:
            monkeypatch.setattr(module, name, inspect.unwrap(getattr(module, name)))


def stopped():
    """An executor that takes nothing more."""
    executor = ThreadPoolExecutor(1)
    executor.shutdown()
    return executor


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"members": "3"}, "`members` must be a positive integer, but is '3'"),
        ({"members": 0}, "`members` must be a positive integer, but is 0"),
        ({"seed": 2**64}, "`seed` must be less than 2\\*\\*64, but is"),
        ({"vary": None}, "`vary` must be distributions by scene key, or a list of KEY=DIST, but is None"),
        ({"vary": "initial.spin_rate=uniform:1:2"}, "`vary` must be distributions by scene key, or a list"),
        ({"vary": {3: "normal:1:1"}}, "`vary` must have keys of a scene, but has 3"),
        ({"observables": "coning_angle"}, "`observables` must be a list of names, but is 'coning_angle'"),
        ({"observables": 3}, "`observables` must be a list of names, but is 3"),
        ({"reduce": "mean"}, "`reduce` must be a list of names, but is 'mean'"),
        ({"reduce": None}, "`reduce` must be a list of names, but is None"),
        ({"sampling": "no"}, "`sampling` must be one of random, sobol, latin, but is 'no'"),
        ({"max_steps": 0}, "`max_steps` must be a positive whole number, but is 0"),
        ({"resume": "no"}, "`resume` must be true or false, but is 'no'"),
        (
            {"executor": 3},
            "`executor` must be an executor of concurrent.futures, or None, but is of type int",
        ),
    ],
)
def test_one_line(scene, arguments, message, tmp_path):
    given = {"members": 2, "vary": VARY} | arguments
    with pytest.raises(InputError, match=f"^{message}"):
        RUN(scene, tmp_path / "run", **given)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("folder", [3, None, ""])
def test_a_folder_that_is_none(scene, folder):
    with pytest.raises(InputError, match=r"^`folder` must be the path of a folder, but is"):
        RUN(scene, folder, members=2, vary=VARY)


def check_that_forking_is_refused(scene, tmp_path):
    """The refusal of an executor that forks."""
    with (
        ProcessPoolExecutor(1, multiprocessing.get_context("fork")) as forks,
        pytest.raises(InputError, match=r"^`executor` must start its processes by spawn .* but forks$"),
    ):
        RUN(scene, tmp_path / "run", members=2, vary=VARY, executor=forks)


def test_executors_that_cannot_compute(scene, tmp_path):
    """One that forks would hang; one that was shut down would give an ensemble without a member."""
    if "fork" in multiprocessing.get_all_start_methods():  # not on Windows, where nothing can hang so
        check_that_forking_is_refused(scene, tmp_path)
    with pytest.raises(
        InputError, match=r"^`executor` must take work .* but does not: RuntimeError: cannot"
    ):
        RUN(scene, tmp_path / "run", members=2, vary=VARY, executor=stopped())
    assert not list(tmp_path.iterdir())


def test_the_environment_of_the_caller_stays(scene, tmp_path, monkeypatch):
    """Members that a thread of this process computes leave its environment alone: JAX may have begun with
    another number of threads, for which its programs are kept. A process of an engine has one thread."""
    monkeypatch.delenv("NPROC", raising=False)
    monkeypatch.setattr(MemberRunner, "compile", lambda _: None)
    identity = json.dumps(task.about(task.task_of(scene, 2, VARY)))
    for driver, threads in ((work.this_process(), None), (("elsewhere", 1), "1")):
        work.runner_of(work.Program(identity, (), None, driver), 1)
        assert os.environ.get("NPROC") == threads
    work.runner_of.cache_clear()


def test_nothing_is_left_of_folders_above(scene, tmp_path):
    """An ensemble that is refused leaves no folder, also none above its own."""
    with pytest.raises(InputError, match=r"\(member 0\)"):
        RUN(scene, tmp_path / "a" / "b" / "run", members=2, vary=["hub.density=grid:-1:800:2"])
    assert not list(tmp_path.iterdir())


def test_numbers_of_numpy_and_a_change_of_directory(scene, tmp_path, monkeypatch):
    """Integers of NumPy are integers, and a folder stays where it was when the call began."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "other").mkdir()
    engine = MadeUp()
    submit = engine.submit

    def moves(function, /, *arguments):
        monkeypatch.chdir(tmp_path / "other")
        return submit(function, *arguments)

    engine.submit = moves
    found = RUN(
        scene, "run", members=np.int64(6), vary=VARY, seed=np.int32(3), observables=["coning_angle"],
        executor=engine,
    )  # fmt: skip
    assert found["coning_angle"][:, 0, 0].tolist() == list(range(6)) and list(found) == ["coning_angle"]
    assert (tmp_path / "run" / "ensemble.h5").exists() and not list((tmp_path / "other").iterdir())
