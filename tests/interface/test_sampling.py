"""Inputs of ensembles: the dependence and the distribution of the members' numbers."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

import esail_jax as esail
from esail_jax.ensembles import Grid, LogNormal, Normal, Uniform, VariationError, draw, parse_variation
from esail_jax.ensembles.sampling import draws_of
from esail_jax.scenes.declarations import rule_of
from esail_jax.scenes.parts import tables_of
from esail_jax.scenes.rules import Kind, SceneError, Shape


@pytest.fixture(scope="module")
def scene():
    return esail.load_scene("baseline", {"tethers.count": 3})


@pytest.fixture
def without_rules(monkeypatch):
    """Draws do not compare every member with the scene's rules, which takes 99 % of the time of 1600
    members. `test_numbers_that_make_no_scene` tests these rules."""
    monkeypatch.setattr("esail_jax.ensembles.sampling.check", lambda scene, inputs: None)


def drawn(scene, *texts, members=64, seed=5, sampling="random"):
    return draw(scene, [parse_variation(text) for text in texts], members, seed, sampling)


SPIN, LENGTHS = "initial.spin_rate=uniform:3e-3:5e-3", "tethers.length[*]=normal:10e3:20"


@pytest.mark.parametrize("sampling", ["random", "sobol", "latin"])
def test_numbers_that_are_drawn_when_they_are_needed(scene, without_rules, monkeypatch, sampling):
    """Any members of an ensemble, in any order and from several blocks, have the numbers of the whole one,
    bit for bit: with several keys, one or a number per tether, and with grids."""
    texts = (SPIN, LENGTHS, "voltage.value[*]=grid:1e4:2e4:2", "hub.density=grid:800:900:3")
    whole = drawn(scene, *texts, members=53, sampling=sampling)
    monkeypatch.setattr("esail_jax.ensembles.sampling.BLOCK", 8)
    draws = draws_of(scene, [parse_variation(text) for text in texts], 53, 5, sampling)
    assert draws.columns == 1 + 3 + 3 + 1
    for members in ([0], [52], [7, 8, 9], [40, 3, 3, 17], list(range(53))):
        part = draws.of(np.array(members))
        assert list(part) == list(whole)
        for key, values in part.items():
            assert np.array_equal(values, whole[key][members]), (key, members)


@pytest.mark.parametrize("sampling", ["random", "sobol"])
def test_a_member_keeps_its_numbers_when_others_join(scene, sampling):
    """A member's numbers do not depend on the number of members; with independent draws also not on other
    inputs."""
    few = drawn(scene, SPIN, LENGTHS, members=8, sampling=sampling)
    many = drawn(scene, SPIN, LENGTHS, members=100, sampling=sampling)
    for key in few:
        assert (few[key] == many[key][:8]).all()
    if sampling == "random":
        alone = drawn(scene, LENGTHS, members=8)
        assert (alone["tethers.length"] == few["tethers.length"]).all()
    assert (drawn(scene, SPIN, members=8, seed=6)["initial.spin_rate"] != few["initial.spin_rate"]).all()


@pytest.mark.parametrize("sampling", ["random", "sobol", "latin"])
def test_distributions(scene, sampling, without_rules):
    """Mean and deviation of 1600 draws are right to four standard errors; limits hold, columns are
    uncorrelated.

    The standard errors are those of independent draws; quasi-random samples are closer.
    """
    found = drawn(scene, SPIN, LENGTHS, members=1600, sampling=sampling)
    spin, lengths = found["initial.spin_rate"], found["tethers.length"]
    assert spin.shape == (1600,) and lengths.shape == (1600, 3)
    assert spin.min() >= 3e-3 and spin.max() <= 5e-3
    error = 4.0 / np.sqrt(1600)
    assert abs(spin.mean() - 4e-3) < error * 2e-3 / np.sqrt(12)
    assert (np.abs(lengths.mean(0) - 10e3) < error * 20).all()
    assert (np.abs(lengths.std(0) / 20 - 1) < error).all()
    columns = np.column_stack([spin, lengths])
    assert (np.abs(np.corrcoef(columns.T) - np.eye(4)) < error).all()


def test_lognormal(scene, without_rules):
    """Draws are positive, however wide the distribution; their logarithms have the median's and the sigma
    of the distribution, to four standard errors."""
    found = drawn(scene, "tethers.length[*]=lognormal:10e3:0.5", members=1600)["tethers.length"]
    logs = np.log(found / 10e3)
    error = 4.0 / np.sqrt(1600)
    assert (found > 0.0).all()
    assert (np.abs(logs.mean(0)) < error * 0.5).all() and (np.abs(logs.std(0) / 0.5 - 1) < error).all()


def test_even_samplings_fill_every_layer(scene):
    """Of 64 members one lies in every 64th of the range.

    A Latin hypercube has this property by construction, a Sobol sequence because 64 is a power of two.
    """
    for sampling in ("latin", "sobol"):
        spin = drawn(scene, SPIN, members=64, sampling=sampling)["initial.spin_rate"]
        layers = np.floor((spin - 3e-3) / 2e-3 * 64)
        assert sorted(layers) == list(range(64))


def test_grids_are_run_through_together(scene):
    """Several grids give every combination once, the last grid fastest, and then repeat."""
    texts = ("voltage.value=grid:10e3:20e3:2", "initial.coning_angle_deg=grid:0:2:3")
    found = drawn(scene, *texts, members=7)
    assert found["voltage.value"].tolist() == [10e3, 10e3, 10e3, 20e3, 20e3, 20e3, 10e3]
    assert found["initial.coning_angle_deg"].tolist() == [0.0, 1.0, 2.0, 0.0, 1.0, 2.0, 0.0]
    each = drawn(scene, "tethers.length[*]=grid:1:2:2", members=8)["tethers.length"]
    assert len({tuple(row) for row in each}) == 8


def test_constants(scene):
    """Distributions of zero width are constants."""
    found = drawn(scene, "hub.radius=normal:2:0", "hub.height=uniform:3:3", members=4)
    assert (found["hub.radius"] == 2.0).all() and (found["hub.height"] == 3.0).all()


@pytest.mark.parametrize(
    "text",
    [
        "tethers.length",
        "length=uniform:1:2",
        "tethers.length=triangle:1:2",
        "tethers.length=uniform:1",
        "tethers.length=uniform:1:two",
        "tethers.length=uniform:2:1",
        "tethers.length=normal:1:-1",
        "tethers.length=normal:1:inf",
        "tethers.length=lognormal:-1:0.1",
        "tethers.length=grid:1:2:0",
        "tethers.length=grid:1:2:2.5",
    ],
)
def test_variations_that_are_none(text):
    """Text that is no variation is refused in one line that shows the syntax."""
    with pytest.raises(VariationError, match=r"^`vary.*` must .+, but is .+$"):
        parse_variation(text)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("tethers.count=uniform:1:2", "`tethers.count` must be a physical number to be varied"),
        ("tethers.lenght=uniform:1:2", "perhaps `tethers.length`"),
        ("hub.radius[*]=uniform:1:2", "a number per tether"),
        ("tethers.length=normal:1:20", "`tethers.length` must be positive, but is -.* (member "),
        ("gravity.acceleration=uniform:1:2", "a key of single numbers"),
        ("integrator.step=uniform:1:2", "physical number"),
    ],
)
def test_numbers_that_make_no_scene(scene, text, words):
    """The message names the key and the first bad member."""
    with pytest.raises(SceneError) as error:
        drawn(scene, text)
    start = words.split(".*")[0]
    assert all(part in str(error.value) for part in words.split(".*")), (start, str(error.value))


def test_the_guide_lists_the_keys_with_a_number_per_tether():
    """The paragraph on `[*]` names every key that accepts it, and no other."""
    guide = (Path(__file__).parents[2] / "docs" / "guide" / "ensembles.md").read_text(encoding="utf-8")
    listed = re.findall(r"`(\w+\.\w+)`", guide.split("\n`[*]` is for ")[1].split("\n\n")[0])
    found = set()
    for kinds in (tables_of("sail"), tables_of("chain")):
        for table, kind in kinds.items():
            rules = {field.name: rule_of(field) for field in dataclasses.fields(kind)}
            found |= {
                f"{table}.{name}"
                for name, rule in rules.items()
                if rule.kind is Kind.NUMBER
                and not rule.structure
                and rule.shape in (Shape.MEMBER, Shape.HISTORY)
            }
    assert set(listed) == found and len(listed) == len(found)


def test_a_key_is_given_once(scene):
    """A key may be varied for all tethers or for each, not both."""
    must = "`vary tethers.length` must be given once, but is given 2 times"
    with pytest.raises(VariationError, match=f"^{must}$"):
        drawn(scene, "tethers.length=uniform:1:2", LENGTHS)


def test_objects_and_texts_describe_the_same(scene):
    """A mapping of objects, a mapping of texts and a list of texts give the same numbers."""
    objects = {
        "initial.spin_rate": Uniform(3e-3, 5e-3),
        "tethers.length": Normal(10_000, 20, per_tether=True),
        "hub.radius": Grid(1, 2, 3),
    }
    texts = {
        "initial.spin_rate": "uniform:3e-3:5e-3",
        "tethers.length[*]": "normal:10e3:20",
        "hub.radius": "grid:1:2:3",
    }
    listed = [f"{key}={text}" for key, text in texts.items()]
    first, *others = (draw(scene, vary, 8, 5) for vary in (objects, texts, listed))
    assert first["tethers.length"].shape == (8, 3) and first["hub.radius"].tolist()[:4] == [1, 1.5, 2, 1]
    for other in others:
        assert list(other) == list(first) and all((other[key] == first[key]).all() for key in first)
    # Files of ensembles hold this text; they are resumed only if it is the same.
    assert parse_variation("hub.radius=grid:1:2:3").text == "hub.radius=grid:1.0:2.0:3.0"
    assert parse_variation(listed[1]).text == "tethers.length[*]=normal:10000.0:20.0"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Uniform(2, 1), "`Uniform` must have a <= b, but has a = 2.0 and b = 1.0"),
        (lambda: Normal(1, -1), "`Normal` must have sd >= 0, but has sd = -1.0"),
        (lambda: Normal(1, np.inf), "`Normal` must have finite numbers, but has sd = inf"),
        (
            lambda: LogNormal(0, 1),
            "`LogNormal` must have median > 0 and sigma >= 0, but has median = 0.0 and sigma = 1.0",
        ),
        (lambda: Grid(1, 2, 2.5), "`Grid` must have a positive integer n, but has n = 2.5"),
        (lambda: Grid(1, 2, 0), "`Grid` must have a positive integer n, but has n = 0.0"),
    ],
)
def test_distributions_that_are_none(make, message):
    """Wrong parameters are refused by the constructor, in one line."""
    with pytest.raises(SceneError) as error:
        make()
    assert str(error.value) == message


@pytest.mark.parametrize(
    ("vary", "message"),
    [
        ({"hub.radius": "uniform:2:1"}, "`hub.radius` must have a <= b, but is uniform:2:1"),
        (
            {"hub.radius": "triangle:2:1"},
            "`hub.radius` must look like one of uniform:a:b, normal:mean",
        ),
        (
            {"hub.radius": Uniform(1, 2, per_tether=True)},
            "`hub.radius[*]` must be a key with a",
        ),
    ],
)
def test_mappings_name_the_key(scene, vary, message):
    with pytest.raises(SceneError) as error:
        draw(scene, vary, 4)
    assert str(error.value).startswith(message)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0,), "`members` must be a positive integer, but is 0"),
        ((4, -1), "`seed` must be an integer that is not negative, but is -1"),
        ((4, 0, "even"), "`sampling` must be one of random, sobol, latin, but is 'even'"),
    ],
)
def test_numbers_of_draws(scene, arguments, message):
    with pytest.raises(SceneError) as error:
        draw(scene, {}, *arguments)
    assert str(error.value) == message


def test_a_scene_is_given_by_name_too():
    """The numbers are those of the scene of that name."""
    vary = {"initial.spin_rate": Normal(4e-3, 4e-5)}
    one, other = (draw(scene, vary, 8, 5) for scene in ("baseline", esail.load_scene("baseline")))
    assert np.array_equal(one["initial.spin_rate"], other["initial.spin_rate"])
