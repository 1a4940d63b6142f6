"""`esail run --terms FILE.py:NAME`: terms that a user wrote, in a run file and on resume."""

import h5py
import numpy as np
import pytest

import esail_jax as esail
import support.own_terms
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.toml_text import to_toml
from support.bits import check_same, esail_run
from support.own_terms import SAIL

FILE = support.own_terms.__file__


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """The small sail as a file."""
    path = tmp_path_factory.mktemp("scenes") / "small.toml"
    path.write_text(to_toml(esail.load_scene("baseline", SAIL)))
    return path


@pytest.mark.nightly
def test_a_run_goes_on_under_the_same_terms_bit_for_bit(scene, tmp_path, capsys):
    """The file names module, class and checksum. Other terms, another order and none are refused in one
    line; the solution of the file cannot be simulated again without them."""
    both, whole, parts = f"{FILE}:both", tmp_path / "whole.h5", tmp_path / "parts.h5"
    assert esail_run(scene, whole, "--terms", both) == 0
    assert esail_run(scene, parts, "--terms", both, "--t-end", "11") == 0
    assert esail_run(scene, parts, "--terms", both, "--resume") == 0
    check_same(parts, whole)
    with h5py.File(whole) as file:
        names = list(file.attrs["own_terms"])
        assert [name.split()[0] for name in names] == ["own_terms.Weight", "own_terms.AxialPush"]
        assert all(len(name.split()[1]) == 16 for name in names)
        assert list(file["numerics"].attrs["terms"])[-2:] == ["AxialPush", "Weight"]
    capsys.readouterr()
    for options, got in (
        ([], "but are missing"),
        (["--terms", f"{FILE}:pulse"], "but are own_terms.Pulse"),
        (["--terms", both, "--terms", f"{FILE}:pulse"], "but are own_terms.Weight"),
    ):
        assert esail_run(scene, parts, *options, "--resume", "--t-end", "30") == 2
        said = capsys.readouterr().err
        assert (
            said.startswith("`--terms` must be own_terms.Weight ") and got in said and said.count("\n") == 1
        )
    solution = esail.load(whole)
    with pytest.raises(SceneError, match=r"`terms` must be given, as the run had own_terms.Weight, "):
        solution.at(10.0)
    terms = support.own_terms.both()
    again = esail.simulate(solution.scene, terms=terms)
    assert np.array_equal(again["tip_position_I"], solution["tip_position_I"])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("terms", "`--terms` must look like FILE.py:NAME, but is 'terms'"),
        ("none.py:x", "`--terms` must name an existing file, but there is no none.py"),
        (f"{FILE}:absent", "`--terms` must name a term, or a list of terms, but "),
        (f"{FILE}:Wrench", "`--terms` must name a term, or a list of terms, but "),
        (f"{FILE}:SAIL", "`terms[0]` must be of one of the kinds of `esail_jax.physics`"),
    ],
    ids=["no colon", "no file", "absent name", "needs arguments", "no term"],
)
def test_what_is_no_term_is_refused_in_one_line(given, message, scene, tmp_path, capsys):
    assert esail_run(scene, tmp_path / "a.h5", "--terms", given) == 2
    said = capsys.readouterr().err
    assert said.startswith(message) and said.count("\n") == 1
    assert not (tmp_path / "a.h5").exists()
