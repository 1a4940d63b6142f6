"""What a process remembers of programs is bounded, can be freed, and comes back when it is needed."""

import jax
import jax.numpy as jnp
import pytest

from kept_programs import call, clear_caches, program_of
from kept_programs.remembered import EXECUTABLES, FUNCTIONS, MAPPINGS, MOST_MAPPINGS, RecentlyUsed, mappings
from toy import square


class Noted:
    """An object that notes when it is let go."""

    def __init__(self, name, gone):
        self.name, self.gone = name, gone

    def forget(self):
        self.gone.append(self.name)


def test_the_least_recently_used_goes():
    gone = []
    a, b, c = (Noted(name, gone) for name in "abc")
    recent = RecentlyUsed(2)
    for one in (a, b, a, c):
        recent.use(one)
    assert gone == ["b"] and len(recent) == 2
    recent.use(b)
    assert gone == ["b", "a"]
    recent.clear()
    assert sorted(gone[2:]) == ["b", "c"] and len(recent) == 0


def test_half_of_them_go_if_the_process_has_too_many_mappings(monkeypatch):
    """Linux ends a process that needs one mapping too many. Half of the objects go when another one comes,
    none when one is used again."""
    gone = []
    a, b, c, d = (Noted(name, gone) for name in "abcd")
    recent = RecentlyUsed(64)
    for one in (a, b, c):
        recent.use(one)
    monkeypatch.setattr("kept_programs.remembered.mappings", lambda: MOST_MAPPINGS + 1)
    recent.use(a)
    assert gone == []
    recent.use(d)
    assert gone == ["b"] and len(recent) == 3
    few = RecentlyUsed(64, least=4)
    for one in (a, b, c, d):
        few.use(one)
    assert gone == ["b"], "what one scene needs stays"


def test_mappings_are_those_of_the_process(monkeypatch, tmp_path):
    assert mappings() > 100 or not MAPPINGS.exists()
    monkeypatch.setattr("kept_programs.remembered.MAPPINGS", tmp_path / "missing")
    assert mappings() == 0


@pytest.fixture
def program(keeper):
    """A program, with an empty store."""
    return program_of(keeper, square, (3.0,), (jnp.zeros(2),))


def test_a_program_that_has_gone_comes_back(keeper, program, monkeypatch):
    """One executable stays in memory. The first of two programs is loaded for its second run."""
    few = RecentlyUsed(1)
    monkeypatch.setattr("kept_programs.program.EXECUTABLES", few)
    other = program_of(keeper, square, (4.0,), (jnp.zeros(2),))
    for _ in range(2):
        assert (program(jnp.asarray([1.0, 2.0])) == jnp.asarray([3.0, 12.0])).all()
        assert (other(jnp.asarray([1.0, 2.0])) == jnp.asarray([4.0, 16.0])).all()
        assert len(few) == 1 and program.program._executable is None


def test_programs_on_several_devices_go_too(keeper, program, monkeypatch):
    """There `jax.jit` runs a program on the devices of its arguments. Its function goes with the
    program."""
    monkeypatch.setattr("kept_programs.operation.uses_executables", lambda: False)
    monkeypatch.setattr("kept_programs.program.EXECUTABLES", RecentlyUsed(1))
    other = program_of(keeper, square, (5.0,), (jnp.zeros(2),))
    for _ in range(2):
        assert (call(program, jnp.asarray([1.0, 2.0])) == jnp.asarray([3.0, 12.0])).all()
        assert program.program._on_devices is not None
        assert (call(other, jnp.asarray([1.0, 2.0])) == jnp.asarray([5.0, 20.0])).all()
        assert program.program._on_devices is None


@pytest.mark.drops_programs
def test_all_programs_are_freed_and_come_back(keeper, program):
    """`clear_caches()` also empties the caches of JAX: a function of `jax.jit` is traced anew."""
    traced = []

    @jax.jit
    def double(x):
        traced.append(x)
        return 2.0 * x

    x = jnp.asarray([1.0, 2.0])
    first = program(x), double(x)
    clear_caches()
    assert len(EXECUTABLES) == 0 and program.program._executable is None
    assert all(function.cache_info().currsize == 0 for function in FUNCTIONS)
    again = program_of(keeper, square, (3.0,), (x,))
    assert again is not program
    for result in (again(x), program(x)):
        assert (result == first[0]).all()
    assert (double(x) == first[1]).all() and len(traced) == 2
