"""Relative wind and thrust at the tips in whole runs: an independent integration, many runs at once, runs
that go on."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from support.pushed_sail import PushedSail
from support.quick import jit
from support.ring_sail import TIGHT, ring_scene
from support.whole_runs import check_going_on

PUSH = {"tip_thrust.force": [2e-3, 3e-3, 2.5e-3, 1e-3, 2e-3]}
ENGINEERING = TIGHT | {"tethers.strain": "engineering", "integrator.t_end": 30.0}
CASES = {
    "relative wind": {"solar_wind.relative": True},
    "tangential tip thrust": PUSH,
    "axial tip thrust": PUSH | {"tip_thrust.direction": "axial"},
    "radial tip thrust and relative wind": PUSH
    | {"tip_thrust.direction": "radial", "solar_wind.relative": True},
}


@pytest.mark.nightly
@pytest.mark.parametrize("case", CASES)
def test_run_follows_an_independent_integration(case, validate):
    """Every signal of five unequal tethers (engineering strain, with a ring) agrees with the independent
    code to 1e-6 of its range, and the parts change the tips by a hundred times what the codes differ by
    (relative wind by 5e-6 m only)."""
    scene = esail.load_scene(ring_scene(ENGINEERING), CASES[case])
    run = esail.simulate(scene)
    exact = PushedSail.of(scene).run(np.asarray(run.time))
    found = {}
    for name, x in exact.items():
        ours = np.asarray(run[name])
        found[name] = np.abs(ours - x).max() / max(np.ptp(x), 1e-9 * np.abs(x).max(), 1e-300)
    worst = max(found, key=found.get)
    validate(
        f"PUSH-{case}", f"five unequal tethers with a ring, {case}",
        "independent code, Runge-Kutta of order 8", "worst signal / range", found[worst], 1e-6,
    )  # fmt: skip
    plain = PushedSail.of(ring_scene(ENGINEERING)).run(np.asarray(run.time))
    tips = exact["tip_position_I"]
    differ = np.abs(np.asarray(run["tip_position_I"]) - tips).max()
    assert np.abs(tips - plain["tip_position_I"]).max() > 100.0 * differ


PARTS = {
    "tethers.wire_radius": 12.5e-6, "voltage.power_limit": 2.0, "solar_wind.relative": True,
    "tip_thrust.force": 1e-3, "tip_thrust.on": 5.0, "tip_thrust.off": 15.0, "tip_thrust.rise_time": 4.0,
}  # fmt: skip
"""Relative wind, thrust at the tips, and a power limit together."""


@pytest.mark.nightly
def test_many_runs_at_once(small):
    """Under `vmap` every member of a batch is the run of its own numbers, to rounding of the steps."""
    forces, limits = jnp.array([5e-4, 2e-3]), jnp.array([1.0, 30.0])

    def end(force, limit):
        given = small | PARTS | {"tip_thrust.force": force, "voltage.power_limit": limit}
        run = esail.simulate("baseline", given, save=["tip_position_I", "electric_power"])
        return run["tip_position_I"][-1], run["electric_power"][-1]

    tips, power = jit(jax.vmap(end))(forces, limits)
    for k in range(2):
        alone, watts = end(float(forces[k]), float(limits[k]))
        assert np.allclose(tips[k], alone, rtol=0, atol=1e-7), "1e-11 of ten kilometres"
        assert watts == pytest.approx(float(power[k]), rel=1e-9)
    assert np.abs(tips[0] - tips[1]).max() > 1e-3 and power[0] == pytest.approx(1.0)


@pytest.mark.nightly
def test_a_run_that_goes_on(small, tmp_path):
    """A run that ends within the pulse and is continued is bit-identical to one run."""
    as_toml = {"solar_wind.relative": "true", "output.interval": 2.0}
    check_going_on(small | PARTS | as_toml, 8, 20, tmp_path)
