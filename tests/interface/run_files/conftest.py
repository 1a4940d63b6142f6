"""Runs of every kind, which the tests of run files share, in compiled calls that are short.

Whatever ended a run early (Ctrl-C, kill -9, a failed step, an earlier t_end), its file opens, and
`--resume` gives a file that is bit-identical to that of an uninterrupted run. This holds for methods of
fixed steps, for collocation and for explicit methods.
"""

import pytest

import esail_jax as esail
import esail_jax.simulation.programs
from support.bits import esail_run
from support.run_kinds import KINDS, SHORT_CALLS


@pytest.fixture(scope="package", autouse=True)
def short_calls():
    """Lets the runs of these tests consist of several calls."""
    programs = esail_jax.simulation.programs
    with pytest.MonkeyPatch.context() as patch:
        for name, value in SHORT_CALLS.items():
            patch.setattr(programs, name, value)
        programs._compiled.cache_clear()
        yield
    programs._compiled.cache_clear()


@pytest.fixture(scope="package")
def scenes(tmp_path_factory):
    """The scene file of every kind."""
    folder = tmp_path_factory.mktemp("scenes")
    paths = {name: folder / f"{name}.toml" for name in KINDS}
    for name, path in paths.items():
        path.write_text(KINDS[name].text)
    return paths


@pytest.fixture(scope="package")
def wholes(scenes, tmp_path_factory):
    """A function: the file of an uninterrupted run of a kind, which no test writes to."""
    folder = tmp_path_factory.mktemp("wholes")

    def of(kind):
        path = folder / f"{kind}.h5"
        if not path.exists():
            assert esail_run(scenes[kind], path) == 0
        return path

    return of


@pytest.fixture(scope="package")
def scene(scenes):
    return scenes["generalized-alpha"]


@pytest.fixture(scope="package")
def whole(wholes):
    """The file of a run with fixed steps to 80 s (two and a half compiled calls)."""
    return wholes("generalized-alpha")


@pytest.fixture(scope="package")
def solution(scene):
    return esail.simulate(str(scene))


@pytest.fixture(scope="package")
def solutions(scenes, solution):
    """A function: the solution of a kind."""
    made = {"generalized-alpha": solution}

    def of(kind):
        if kind not in made:
            made[kind] = esail.simulate(str(scenes[kind]))
        return made[kind]

    return of
