"""Designs of the voltages of a sail with auxiliary tethers."""

import h5py
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.cli import main
from esail_jax.design import Design
from esail_jax.design.design_file import read_history
from esail_jax.design.law_variables import law_variables
from support.quick import jit

SMALL = {
    "tethers.count": 3,
    "tethers.elements": 1,
    "auxiliary_tethers.length": 17322.0,
    "integrator.t_end": 400.0,
    "integrator.tolerance": 1e-12,
    "output.interval": 20.0,
    "voltage.law": "harmonic",
    "voltage.cosine": [0.0],
    "voltage.sine": [0.0],
    "voltage.maximum": 40e3,
}
"""Three tethers, whose tips are joined by a ring that cannot push, over a quarter of a turn."""

WEIGHTS = {"mean-torque": 1.0, "lagging": 0.1}


@pytest.fixture(scope="module", autouse=True)
def _compiled_quickly():
    """The objective is compiled with the options for programs that run a few times."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("esail_jax.design.problem.jit", jit)
        yield


@pytest.mark.nightly
def test_design_of_a_sail_with_a_ring_from_the_shell(tmp_path, validate):
    """Two iterations lower the objective, which is the sum of the weights without modulation; and the
    designed scene, which keeps its ring, runs.

    The gradient of the objective by the harmonics of the voltages after the first iteration, in reverse
    mode through the ring, its steady start and the run, is the difference quotient of fourth order of
    concrete runs. 1e-6: the tolerance of the runs, 1e-12, over the step, 1e-3 of the voltage, and the
    torque, a quarter of which is left."""
    settings = [x for key, value in SMALL.items() for x in ("--set", f"{key}={shown(value)}")]
    weights = [x for name, weight in WEIGHTS.items() for x in ("--objective", f"{name}={weight}")]
    folder = tmp_path / "design"
    given = ["design", "auxiliary-tethers", *settings, *weights, "--quiet", "-o", str(folder)]
    assert main([*given, "--iterations", "2"]) == 0
    history = read_history(folder / "design.h5")[:, 0]
    assert len(history) == 3 and abs(history[0] - 1.1) < 1e-6
    assert history[1] < history[0] and history[2] < 0.5 * history[0]
    scene, after = esail.load_scene("auxiliary-tethers", SMALL), esail.load(folder / "after.h5")
    assert esail.load_scene(folder / "designed.toml").auxiliary_tethers == scene.auxiliary_tethers
    assert np.isfinite(after["auxiliary_tension"]).all()

    with h5py.File(folder / "design.h5") as file:
        x, slope = file["x"][1, 0], file["gradient"][1, 0]
    design, along, e = Design(scene, WEIGHTS, law_variables(scene)), np.array([1.0, 0.5]), 1e-2
    ends = [float(design.objective_at(x + s * e * along)) for s in (-2, -1, 1, 2)]
    quotient = (8.0 * (ends[2] - ends[1]) - (ends[3] - ends[0])) / (12.0 * e)
    error = abs(float(slope @ along) / quotient - 1.0)
    validate(
        "RING-8", "design with a ring, two harmonics", "differences", "gradient, relative", error, 1e-6
    )
    assert np.abs(x).min() > 1e-3 and abs(history[1] - 1.1) > 0.1


def shown(value):
    """A value as the command line takes it."""
    return f'"{value}"' if isinstance(value, str) else str(value)
