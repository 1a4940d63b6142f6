"""Programs are kept between processes by everything that decides what they compute."""

import functools
import os
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from kept_programs import Environment, Store, Unkeyed, keys
from toy import Kind, Pair, dot, square


class Mine(NamedTuple):
    """A type that is defined outside the package."""

    x: int


@pytest.fixture
def environment(keeper):
    return keeper.environment


@pytest.mark.parametrize(
    "one, other",
    [
        (1, 1.0), (1, True), (0.1, 0.1 + 1e-16), ("1", 1), ((1, 2), [1, 2]), ((1, (2, 3)), (1, 2, 3)),
        (np.zeros(2), np.zeros((2, 1))), (np.zeros(2), np.zeros(2, int)), (np.zeros(2), np.ones(2)),
        (0.0, -0.0), (dot, square), ({"a": 1}, {"a": 2}), (Kind.NUMBER, Kind.INTEGER), (None, "None"),
        (functools.partial(dot, 1), functools.partial(dot, 2)), (Pair(1, 2), Pair(1, 3)),
    ],
)  # fmt: skip
def test_texts_of_different_values_differ(environment, one, other):
    assert environment.text_of(one) != environment.text_of(other)


def test_text_does_not_depend_on_order_or_identity(environment):
    text_of = environment.text_of
    assert text_of({"a": 1, "b": 2}) == text_of({"b": 2, "a": 1})
    assert text_of(frozenset("abc")) == text_of(frozenset("cba"))
    assert text_of(np.arange(6.0).reshape(2, 3).T) == text_of(np.arange(6.0).reshape(2, 3).T.copy())
    assert text_of(jnp.ones(2)) == text_of(np.ones(2))


@pytest.mark.parametrize("x", [lambda x: x, Mine, Mine(1), object(), np.array([object()]), (1, [Mine(2)])])
def test_what_is_defined_elsewhere_has_no_key(environment, x):
    """Its source is not part of the key."""
    with pytest.raises(Unkeyed):
        environment.text_of(x)
    assert environment.key_of(x) is None


def test_a_key_depends_on_settings_and_environment(environment):
    here = environment.key_of(1)
    with jax.default_matmul_precision("float32"):
        assert environment.key_of(1) != here
    assert environment.key_of(1) == here
    vars(environment)["text"] = "another processor"
    assert environment.key_of(1) != here


def test_environment_holds_sources_flags_and_the_machine(tmp_path, folder, monkeypatch):
    """Another source of the package, other flags, or another machine make another environment, and so
    other keys."""
    (tmp_path / "keys.py").write_text("one")
    store = Store("toy", "TOY_CACHE", b"toy")

    def text(machine="one"):
        return Environment("toy", tmp_path, store, machine=lambda: machine).text

    before = text()
    assert text() == before
    texts = {before, text("another")}
    (tmp_path / "keys.py").write_text("two")
    texts.add(text())
    monkeypatch.setenv("XLA_FLAGS", "--xla_another=true")
    texts.add(text())
    assert len(texts) == 4


def test_environment_holds_the_digest_of_jaxlib(keeper, tmp_path, monkeypatch):
    """A build of jaxlib with the same version may compute something else. The digest of a file is computed
    once, and again when the file has changed."""
    assert keys.binary_of_jaxlib().stat().st_size > 1e7
    binary = tmp_path / "libjax.so"
    binary.write_bytes(b"one")
    first = keys.digest_of(binary, keeper.store)
    assert first == keys.digest_of(binary, keeper.store)
    monkeypatch.setattr(keys, "binary_of_jaxlib", lambda: binary)
    before = Environment("toy", tmp_path, keeper.store).text
    binary.write_bytes(b"other")
    assert keys.digest_of(binary, keeper.store) != first
    assert Environment("toy", tmp_path, keeper.store).text != before
    monkeypatch.setenv("TOY_CACHE", "off")
    assert keys.digest_of(binary, keeper.store) == "", "without a store nothing is read"


def test_a_source_that_has_changed_since_has_no_key(tmp_path, folder):
    """What has been imported may be another text than that of the file."""
    source = tmp_path / "mine.py"
    source.write_text("a = 1")
    os.utime(source, (0.0, 0.0))
    environment = Environment(
        "toy", tmp_path, Store("toy/programs", "TOY_CACHE", b"toy"), machine=lambda: "one"
    )
    assert environment.key_of("a")
    os.utime(source, (environment.made + 10.0,) * 2)
    assert environment.key_of("a") is None
    source.unlink()
    assert environment.key_of("a") is None


def test_what_shares_a_name_with_another_object_has_no_key(environment):
    """A wrapped function has the name of the one inside, and a method does not name its object."""
    assert environment.key_of(dot)
    wrapped = functools.wraps(dot)(lambda a, b: 2.0 * dot(a, b))
    assert environment.key_of(wrapped) is None
    assert environment.key_of(jax.grad(dot)) is None
    assert environment.key_of(Path("a").exists) is None
