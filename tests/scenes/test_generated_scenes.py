"""Generated scenes: whatever stands in a scene, it is read, or refused in one line that names a key.

Each case changes a built-in scene at a few places: other values, lists of other lengths, keys of other
tables, removed keys and tables, or other letters in the text of the file. Nothing is compiled. The cases
are the same in every run (`derandomize`); 1,500 in all.
"""

import math
import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import esail_jax as esail
from esail_jax.scenes.declarations import rule_of
from esail_jax.scenes.loading import builtin_names, builtin_text, load_scene, parse
from esail_jax.scenes.parts import names_of, tables_of
from esail_jax.scenes.rules import Kind
from esail_jax.scenes.toml_text import to_toml

KEYS = sorted(
    {
        f"{table}.{name}"
        for tables in (tables_of("sail"), tables_of("chain"))
        for table, content in tables.items()
        for name in names_of(content)
    }
)
NAMES = sorted(
    {
        name
        for tables in (tables_of("sail"), tables_of("chain"))
        for content in tables.values()
        for field in content.__dataclass_fields__.values()
        if rule_of(field).kind is Kind.CHOICE
        for name in rule_of(field).choices
    }
)

numbers = st.one_of(
    st.floats(),
    st.integers(-3, 20),
    st.floats(-1e4, 1e4, allow_nan=False),
    st.sampled_from([0.0, -1.0, 1e300, -1e300, 5e-324, 10**400, math.nan, math.inf]),
)
values = st.one_of(
    numbers,
    st.booleans(),
    st.text(max_size=12),
    st.sampled_from(NAMES),
    st.lists(numbers, max_size=13),
    st.lists(st.lists(numbers, max_size=4), max_size=4),
    st.lists(st.one_of(st.text(max_size=3), st.none(), numbers), max_size=3),
    st.dictionaries(st.text(max_size=3), numbers, max_size=2),
    st.none(),
    st.builds(np.array, st.lists(st.floats(), max_size=4)),
    st.binary(max_size=4),
)
overrides = st.dictionaries(
    st.one_of(st.sampled_from(KEYS), st.text(max_size=8), st.sampled_from(sorted(tables_of("sail")))),
    values,
    max_size=4,
)

MESSAGE = re.compile(r"`.*` must .+, but .+", re.DOTALL)

generated = settings(
    derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow], max_examples=500
)


def check(read):
    """A scene that is read survives being written and read again; any other is refused in one line."""
    try:
        scene = read()
    except esail.SceneError as error:
        text = str(error)
        assert MESSAGE.fullmatch(text) and text.count("\n") == 0 and len(text) < 400, text
        return
    text = to_toml(scene)
    assert to_toml(parse(text, "written.toml")) == text
    assert repr(scene) and scene._repr_html_()


@pytest.mark.nightly
@generated
@given(st.sampled_from(builtin_names()), overrides)
def test_any_override_is_taken_or_refused_in_one_line(name, changes):
    check(lambda: load_scene(name, changes))


@pytest.mark.nightly
@generated
@given(st.sampled_from(builtin_names()), st.data())
def test_a_file_with_other_values_is_read_or_refused_in_one_line(name, data):
    """Up to three lines of the file get other values, or are left out, or written twice."""
    lines = builtin_text(name).splitlines()
    for _ in range(data.draw(st.integers(1, 3))):
        row = data.draw(st.integers(0, len(lines) - 1))
        kind = data.draw(st.sampled_from(["value", "remove", "repeat"]))
        if kind == "value" and "=" in lines[row]:
            lines[row] = f"{lines[row].partition('=')[0]}= {toml_of(data.draw(values))}"
        elif kind == "remove":
            lines[row] = ""
        else:
            lines.append(lines[row])
    check(lambda: parse("\n".join(lines), "changed.toml"))


@pytest.mark.nightly
@generated
@given(st.sampled_from(builtin_names()), st.data())
def test_a_file_with_other_letters_is_read_or_refused_in_one_line(name, data):
    """Some letters of the file are replaced, as by a faulty disk or a careless editor."""
    text = list(builtin_text(name))
    for _ in range(data.draw(st.integers(1, 4))):
        text[data.draw(st.integers(0, len(text) - 1))] = data.draw(st.text(max_size=2))
    check(lambda: parse("".join(text), "changed.toml"))


def toml_of(value):
    """A value in TOML notation, or something near to it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | np.ndarray):
        return "[" + ", ".join(toml_of(x) for x in value) + "]"
    if isinstance(value, str):
        return '"' + value + '"'
    return repr(value)
