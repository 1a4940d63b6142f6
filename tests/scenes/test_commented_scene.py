"""`esail init`: a built-in scene with a comment on every key stands for the same scene."""

import re

import pytest

from esail_jax import cli
from esail_jax.scenes.key_reference import describe_keys
from esail_jax.scenes.loading import builtin_names, builtin_text, load_scene, parse
from esail_jax.scenes.toml_text import commented


@pytest.mark.parametrize("name", builtin_names())
def test_a_commented_scene_is_the_same_scene(name):
    assert parse(commented(builtin_text(name)), name) == load_scene(name)


@pytest.mark.parametrize("name", builtin_names())
def test_defaults_that_are_written_out_change_nothing(name):
    """Every key that a scene leaves out stands in a comment with its default. Without the `#` it gives the
    same scene."""
    text = commented(builtin_text(name))
    written, count = re.subn(r"^# (\w+ = \S.*)$", r"\1", text, flags=re.MULTILINE)
    assert count and parse(written, name) == load_scene(name)


@pytest.mark.parametrize("name", builtin_names())
def test_every_key_of_every_table_is_there_once_with_its_unit_and_meaning(name):
    scene, text = load_scene(name), commented(builtin_text(name))
    model = "sail" if scene.chain is None else "chain"
    parts = re.split(r"^\[(\w+)\]$", text, flags=re.MULTILINE)
    tables = dict(zip(parts[1::2], parts[2::2], strict=True))
    for key in describe_keys():
        if model not in key.models or key.table not in tables:
            continue
        (line,) = re.findall(rf"^(?:# )?{key.name} =.*$", tables[key.table], flags=re.MULTILINE)
        unit = "" if key.unit == "-" else f"{key.unit}: "
        assert f"# {unit}{key.doc}" in line


@pytest.mark.parametrize("name", builtin_names())
def test_tables_that_are_left_out_show_their_keys(name):
    """Every table of the model is there, as a heading or as a comment; the keys of one that is left out
    follow it, with unit and meaning. No comment names a source file, which users do not have at hand."""
    scene, text = load_scene(name), commented(builtin_text(name))
    model = "sail" if scene.chain is None else "chain"
    parts = re.split(r"^# \[{1,2}(\w+)\]{1,2}$", text, flags=re.MULTILINE)
    tables = dict(zip(parts[1::2], parts[2::2], strict=True))
    absent = {key.table for key in describe_keys() if model in key.models and key.table not in scene.tables}
    assert set(tables) == absent and absent
    for key in describe_keys():
        if model in key.models and key.table in absent:
            (line,) = re.findall(rf"^#   {key.name} =.*$", tables[key.table], flags=re.MULTILINE)
            assert key.doc in line and ("Must be given." in line) == key.required
    assert ".py" not in text


def test_a_table_that_is_left_out_can_be_used():
    """Without the `#` of its heading and of two keys, a release is part of the scene."""
    text = commented(builtin_text("baseline"))
    text = text.replace("# [[event]]", "[[event]]")
    for key, value in (("time", "10.0"), ("release", "2")):
        head, _, event = text.rpartition("[[event]]")
        text = head + "[[event]]" + re.sub(rf"#   {key} =", f"  {key} = {value}", event)
    assert parse(text, "mine") == load_scene("baseline", {"event.time": [10.0], "event.release": [2]})


def test_a_name_that_is_no_scene_is_answered_by_the_nearest(capsys):
    assert cli.main(["init", "basline"]) == 2
    assert capsys.readouterr().err.endswith("but is 'basline' (perhaps `baseline`)\n")


def test_a_remark_of_the_scene_stays():
    """The built-in file says where a number comes from; the comment on the key keeps it."""
    assert "Here: 7801 kg/m^3, radius 1 mm, 0.1 m." in commented(builtin_text("steel-chain"))
    assert "# Turning axes: x away from the Earth" in commented(builtin_text("tethered-satellite"))


def test_the_command_writes_a_file_once(tmp_path, capsys):
    path = tmp_path / "mine.toml"
    assert cli.main(["init", "truss", "-o", str(path)]) == 0
    assert load_scene(path) == load_scene("truss")
    assert cli.main(["init", "truss"]) == 0
    assert capsys.readouterr().out == path.read_text()
    path.write_text("mine")
    assert cli.main(["init", "truss", "-o", str(path)]) == 2
    assert capsys.readouterr().err == f"`{path}` must not exist, but does\n"
    assert path.read_text() == "mine"
