"""Slips of a first session: each is answered so that the next try succeeds."""

import os
import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

import esail_jax as esail
from esail_jax import cli
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.plausibility import doubts

ROOT = Path(__file__).parents[2]


def test_version_is_that_of_the_package(capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"esail_jax {metadata.version('esail_jax')}\n"


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_that_ends_ends_the_command_without_a_word(unbuffered):
    """As in `esail scenes | head -0`: the code is that of SIGPIPE in a shell, and nothing is on stderr."""
    reading, writing = os.pipe()
    os.close(reading)
    ran = subprocess.run(
        [sys.executable, "-m", "esail_jax", "scenes"], stdout=writing, stderr=subprocess.PIPE,
        env=os.environ | {"PYTHONUNBUFFERED": unbuffered},
    )  # fmt: skip
    os.close(writing)
    assert (ran.returncode, ran.stderr) == (141, b"")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs the device /dev/full, which is missing")
def test_output_that_cannot_be_written_is_one_line():
    with open("/dev/full", "wb") as full:
        ran = subprocess.run(
            [sys.executable, "-m", "esail_jax", "scenes"], stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert ran.returncode == 2 and re.fullmatch(r".*No space left.*\n", ran.stderr)


@pytest.mark.parametrize(
    "words", [["voltage.value", "=", "15e3"], ["voltage.value", "=15e3"], ["voltage.value=", "15e3"]]
)
def test_blanks_around_the_equals_sign_of_a_setting(words, tmp_path, capsys):
    path = tmp_path / "run.h5"
    assert cli.main(["run", "baseline", "--set", *words, "-o", str(path)]) == 2
    must = "`--set` must be table.key=VALUE without blanks around `=`"
    assert capsys.readouterr().err == f"{must}, but is {' '.join(words)}\n"
    assert not path.exists()


def test_other_superfluous_words_are_named(tmp_path, capsys):
    for setting in ("voltage.value=15e3", "voltage.value = 15e3"):
        arguments = ["run", "baseline", "--set", setting, "-o", str(tmp_path / "run.h5"), "more"]
        assert cli.main(arguments) == 2
        assert capsys.readouterr().err.startswith("esail: unrecognized arguments: more ")


@pytest.mark.parametrize("function", [esail.simulate, esail.run])
def test_keywords_that_are_keys_of_a_scene(function):
    """The message shows the key as overrides name it; if several tables have it, all of them."""
    for name, shown in (
        ("t_end", r'{"integrator.t_end": ...}'),
        ("mass", r'{"hub.mass": ...} or {"remote_units.mass": ...} or {"chain.mass": ...}'),
        ("tend", r'{"integrator.t_end": 100.0}'),
    ):
        with pytest.raises(TypeError) as caught:
            function("baseline", **{name: 100.0})
        call = f"{function.__name__}(scene, {shown})"
        must = f"`{function.__name__}` has no argument `{name}`: values of scene keys are given by key"
        assert str(caught.value) == f"{must}, as in {call}"


@pytest.mark.parametrize(
    ("words", "first"),
    [
        (["foo"], "COMMAND must be run or test, but is foo"),
        (["run", "more"], "`run` must be given alone, but more comes with it"),
    ],
)
def test_bootstrap_names_a_word_that_it_does_not_know(words, first):
    ran = subprocess.run([sys.executable, ROOT / "bootstrap.py", *words], capture_output=True, text=True)
    assert ran.returncode == 2 and ran.stdout == ""
    assert ran.stderr.splitlines()[0] == first and "bootstrap.py test" in ran.stderr


@pytest.mark.nightly
def test_a_doubt_about_a_unit_is_told_once(tmp_path, capsys):
    """Before the run, because it may take long. The run file keeps it, and `esail info` tells it."""
    settings = {"tethers.length": 12.0, "tethers.count": 2, "tethers.elements": 1, "integrator.t_end": 5.0}
    words = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
    path = str(tmp_path / "run.h5")
    (doubt,) = doubts(load_scene("baseline", settings))
    assert cli.main(["run", "baseline", *words, "-o", path]) == 0
    out, err = capsys.readouterr()
    assert (out.count(doubt), err.count(doubt)) == (0, 1)
    assert cli.main(["info", path]) == 0
    assert doubt in capsys.readouterr().out
