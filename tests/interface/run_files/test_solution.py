"""Solutions of `simulate` and chunks of `run` in Python."""

import inspect
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.simulation.arguments import check_start
from esail_jax.simulation.results import join
from esail_jax.steppers.fixed_step import STEPS_PER_FACTORISATION
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
from support.bits import same_bits
from support.quick import quickly
from support.run_kinds import KINDS, OBSERVABLES


def test_a_solution_is_a_mapping(solution):
    assert "voltage" in solution and "kinetic_energy" in solution and "nonsense" not in solution
    assert 0 not in solution and None not in solution
    names = list(solution)
    assert list(solution.keys()) == names == list(dict(solution)) and len(solution) == len(names)
    assert set(OBSERVABLES) <= set(names)
    assert all(dict(solution)[name] is solution[name] for name in names)
    assert [name for name, _ in solution.items()] == names
    assert solution.get("nonsense") is None
    with pytest.raises(KeyError, match=r"'coning' is no observable of this run .perhaps `coning_angle`."):
        solution["coning"]
    assert solution.units()["kinetic_energy"] == "J"


def test_a_run_starts_from_a_point_only(solution):
    """A solution or its checkpoint is refused in one line. The check of types in the tests is left out,
    which would come first."""
    for start in (solution, solution.checkpoint):
        with pytest.raises(
            esail.SceneError, match=r"`start` must be a point, such as `solution\.final_state`"
        ):
            inspect.unwrap(check_start)(solution.scene, start)


def test_a_solution_says_what_it_is(solution, scene):
    lines = repr(solution).splitlines()
    count = len(solution)
    assert lines[0] == f"Solution: {count} observables at 230 instants from 0 to 80 s"
    assert re.fullmatch(r"  generalized-alpha: 800 steps in \d+\.\d\d s, compiling \d+\.\d\d s", lines[1])
    assert lines[2] == "  The run reached its end time." and len(lines) == 3
    shapes = jax.eval_shape(lambda x: esail.simulate(str(scene), {"voltage.value": x}), 20e3)
    assert repr(shapes) == f"Solution({count} observables at 230 instants, under a trace)"


@pytest.mark.parametrize("kind", quickly(KINDS))
def test_a_run_goes_on_from_a_final_state(kind, solutions, tmp_path):
    """The final state of a file is that of the solution, and a run to a later end goes on from it. Step
    sizes and first guesses begin anew, so that the results agree within the errors of the method."""
    whole, scale = solutions(kind), KINDS[kind].scale
    first = esail.simulate(whole.scene, {"integrator.t_end": 35.0 * scale})
    assert first.final_state.time == 35.0 * scale
    path = tmp_path / "a.h5"
    esail.save(first, path)
    loaded = esail.load(path)
    assert same_bits(loaded.final_state, first.final_state)
    seen = []
    for state in (first.final_state, loaded.final_state):
        later = esail.simulate(whole.scene, start=state)
        assert later.time.tolist() == whole.time[100:].tolist() and later.time[0] == 35.0 * scale
        for name in later:
            exact = np.asarray(whole[name])
            size = np.nan_to_num(np.ptp(exact)) + 1e-3 * np.nan_to_num(abs(exact).max())
            if name in ("energy_balance_error", "energy_error"):
                size = np.ptp(whole["kinetic_energy"]) if name == "energy_balance_error" else 1.0
            np.testing.assert_allclose(later[name], exact[100:], rtol=0, atol=1e-4 * size, err_msg=name)
        seen.append(later)
    assert same_bits(dict(seen[0]), dict(seen[1]))
    assert seen[0].checkpoint is None, "the scene's own run would go on otherwise"


@pytest.mark.parametrize("kind", quickly(KINDS))
def test_observables_at_a_time_are_those_of_a_run_that_saves_it(kind, solutions):
    solution, scale = solutions(kind), KINDS[kind].scale
    time = 23.456 * scale
    saved = esail.simulate(solution.scene, times=sorted({*solution.time, time}))
    row = int(np.searchsorted(saved.time, time))
    found = solution.at(time)
    assert list(found) == list(solution)
    assert same_bits(found, {name: saved[name][row] for name in saved})
    row = int(np.searchsorted(solution.time, 50.0 * scale))
    assert same_bits(
        solution.at(float(solution.time[row])), {name: solution[name][row] for name in solution}
    )
    for outside in (-1.0, 81.0 * scale):
        with pytest.raises(ValueError, match="must lie within the run"):
            solution.at(outside)


@pytest.mark.nightly
def test_observables_at_a_time_of_a_run_from_a_state(solution):
    """The run is taken again from where it began, and with the method that it had."""
    start = esail.simulate(solution.scene, {"integrator.t_end": 7.0, "voltage.value": 1e3}).final_state
    stepper = GeneralizedAlpha(jnp.asarray(0.05), jnp.asarray(0.5))
    later = esail.simulate(solution.scene, start=start, stepper=stepper, save=["kinetic_energy"])
    assert list(later) == ["kinetic_energy"] and later.stats["method"] == "generalized-alpha"
    found = later.at(float(later.time[9]))
    assert same_bits(found, {"kinetic_energy": later["kinetic_energy"][9]})


@pytest.mark.parametrize("kind", quickly(KINDS))
def test_the_chunks_of_a_run_are_its_solution(kind, solutions):
    solution = solutions(kind)
    chunks = list(esail.run(solution.scene))
    assert len(chunks) > 2
    assert np.concatenate([chunk.time for chunk in chunks]).tolist() == solution.time.tolist()
    for part in ("observables", "numerics"):
        joined = join([getattr(chunk, part) for chunk in chunks])
        assert joined.keys() == getattr(solution, part).keys()
        assert same_bits(joined, dict(getattr(solution, part)))
    reached = [chunk.reached for chunk in chunks]
    assert reached == sorted(reached)
    assert all(chunk.reached >= chunk.time[-1] - 1e-9 for chunk in chunks)


def test_progress_is_told_the_time_reached(solution):
    reached = []
    again = esail.simulate(solution.scene, progress=reached.append)
    assert same_bits(dict(again), dict(solution))
    assert reached == [chunk.reached for chunk in esail.run(solution.scene)]


def test_only_the_named_observables_are_saved(solution, tmp_path):
    names = ["tip_position_I", "kinetic_energy"]
    some = esail.simulate(solution.scene, save=names)
    assert list(some) == names
    for name in names:
        np.testing.assert_allclose(some[name], solution[name], rtol=1e-12)
    esail.save(some, tmp_path / "a.h5")
    assert set(esail.load(tmp_path / "a.h5")) == set(names)
    with pytest.raises(
        esail.SceneError, match=r"`save` must hold names of observables, but has 'nonsense'"
    ):
        esail.simulate(solution.scene, save=["nonsense"])


def test_given_times_are_saved(solution):
    times = [0.0, 1.0, 1.75, 2.1, 200 * 0.35]
    some = esail.simulate(solution.scene, times=times)
    assert some.time.tolist() == times
    rows = [0, 5, 6, 200]
    for name in solution:
        at = np.asarray(some[name])[[0, 2, 3, 4]]
        assert at.tobytes() == np.asarray(solution[name])[rows].tobytes(), name
    for bad in ([2.0, 1.0], [], [-1.0], [np.nan]):
        with pytest.raises(esail.SceneError, match=r"`times` must increase from 0 on, but is"):
            esail.simulate(solution.scene, times=bad)


@pytest.mark.parametrize("kind", quickly(KINDS))
def test_a_run_stops_at_the_largest_number_of_steps(kind, solutions):
    solution = solutions(kind)
    most = solution.steps // 2
    with pytest.raises(esail.SimulationError, match="max_steps") as raised:
        esail.simulate(solution.scene, max_steps=most)
    assert raised.value.result == esail.RESULTS.too_many_steps
    cut = esail.simulate(solution.scene, max_steps=most, throw=False)
    assert cut.result == esail.RESULTS.too_many_steps and cut.stats["message"] == str(raised.value)
    assert most <= cut.steps < most + 2 * STEPS_PER_FACTORISATION
    good = np.isfinite(cut["kinetic_energy"])
    rows = int(good.sum())
    assert good[:rows].all() and 50 < rows < 200 and cut.time.tolist() == solution.time.tolist()
    for name in solution:
        values = np.asarray(cut[name])
        assert values[:rows].tobytes() == np.asarray(solution[name])[:rows].tobytes(), name
        assert np.isnan(values[rows:]).all(), name
    assert cut.final_state.time == solution.time[rows - 1]
    assert esail.simulate(solution.scene, max_steps=solution.steps).result == esail.RESULTS.successful
    for bad in (0, -1):
        with pytest.raises(esail.SceneError, match=r"`max_steps` must be a positive whole number"):
            esail.simulate(solution.scene, max_steps=bad)


def test_a_run_that_saves_nothing_before_it_fails_is_nan(solution):
    cut = esail.simulate(solution.scene, times=[70.0, 75.0], max_steps=100, throw=False)
    assert cut.result == esail.RESULTS.too_many_steps and list(cut) == list(solution)
    for name in solution:
        assert cut[name].shape == (2, *solution[name].shape[1:]) and np.isnan(cut[name]).all()


def test_a_solution_becomes_a_dataset(solution):
    data = solution.to_xarray()
    assert set(data.data_vars) == set(solution)
    assert data["time"].attrs["units"] == "s"
    tips = data["tip_position_I"]
    assert tips.dims[:2] == ("time", "tether") and tips.attrs["units"] == "m"
    assert same_bits({n: data[n].values for n in solution}, {n: np.asarray(solution[n]) for n in solution})
