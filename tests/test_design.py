"""Designs: gradients of every objective, what an optimisation reaches, and going on with one."""

import jax
import numpy as np
import pytest

import esail_jax as esail
from esail_jax import objectives
from esail_jax.cli import main
from esail_jax.design import Design, Variable, inward, outward

SMALL = {
    "tethers.count": 3,
    "tethers.elements": 2,
    "integrator.t_end": 400.0,
    "output.interval": 20.0,
    "integrator.tolerance": 1e-8,
    "voltage.law": "harmonic",
    "voltage.cosine": [0.05],
    "voltage.sine": [0.02],
    "voltage.maximum": 40e3,
}
FREE = {"voltage.cosine": Variable([0.0], 0.1), "voltage.sine": Variable([0.0], 0.1)}


def problem(**changes):
    settings = {"weights": {"mean-torque": 1.0, "thrust": 1.0}} | changes
    return Design(esail.load_scene("baseline", SMALL), variables=FREE, **settings)


@pytest.fixture(scope="module")
def torque():
    return problem()


def test_a_variable_keeps_its_limits():
    """Between its limits by construction, and where it was told to start."""
    for variable in (Variable([0.2, 0.9], 0.1, 0.0, 1.0), Variable([3.0], 2.0)):
        assert np.allclose(outward(variable, inward(variable)), variable.start, rtol=1e-12)
    far = outward(Variable([0.5], 0.1, 0.0, 2.0), np.linspace(-1e3, 1e3, 999))
    assert far.min() >= 0.0 and far.max() <= 2.0


@pytest.mark.slow
def test_mean_torque_is_cancelled(torque):
    """A first harmonic of half a percent does it: the objective, a mean over time, falls by ten
    digits in four iterations, and the thrust is kept. At no modulation both are one by definition, and
    zero: nothing is missing."""
    states = torque.run(4)
    assert abs(float(states[0].value[0]) - 1.0) < 1e-6
    assert float(states[-1].value[0]) < 1e-10
    after = esail.simulate(torque.designed(states[-1].x[0]))
    found = objectives.values(after, ("mean-torque", "thrust"))
    assert found["mean-torque"] < 1e-6 * torque.before["mean-torque"]
    assert found["thrust"] > 0.99 * torque.before["thrust"]
    amplitude = np.abs(torque.designed(states[-1].x[0]).voltage.cosine[0])
    assert 1e-4 < amplitude < 0.1


@pytest.mark.slow
def test_gradient_of_every_objective():
    """Against central differences of concrete runs, each objective over its value without modulation."""
    names = [name for name in objectives.NAMES if name != "thrust"]
    design = problem(weights=dict.fromkeys(names, 1.0))
    x = np.array([0.5, -0.3])

    def each(x):
        run = esail.simulate(design.scene, design.overrides(x))
        found = objectives.values(run, tuple(names))
        return jax.numpy.stack([found[name] / design.before[name] for name in names])

    exact = jax.jit(jax.jacrev(each))(x)
    for i, along in enumerate(np.eye(2)):
        e = 1e-3
        ends = [np.asarray(each(x + step * along)) for step in (-2 * e, -e, e, 2 * e)]
        quotient = (8 * (ends[2] - ends[1]) - (ends[3] - ends[0])) / (12 * e)
        scale = np.abs(exact).max(1)
        assert (np.abs(quotient - exact[:, i]) < 1e-4 * scale).all(), (quotient, exact[:, i])


@pytest.mark.slow
def test_a_design_from_the_shell_goes_on_as_if_uninterrupted(tmp_path, capsys):
    """Three iterations, or one and then two more: the same numbers, to the last bit; a design that is there
    is not overwritten, and another one not gone on with."""
    settings = [x for k, v in SMALL.items() if not k.startswith("voltage") for x in ("--set", f"{k}={v}")]
    command = ["design", "baseline", *settings, "--quiet", "-o"]
    once, twice = tmp_path / "once", tmp_path / "twice"
    assert main([*command, str(once), "--iterations", "3"]) == 0
    assert main([*command, str(twice), "--iterations", "1"]) == 0
    assert main([*command, str(twice), "--iterations", "3", "--resume"]) == 0
    for name in ("designed.toml", "design.png", "before.h5", "after.h5"):
        assert (twice / name).exists()
    assert (once / "designed.toml").read_text() == (twice / "designed.toml").read_text()
    assert main([*command, str(once)]) == 2
    assert "must not exist" in capsys.readouterr().err
    assert main([*command, str(once), "--resume", "--objective", "spin=1"]) == 2
    assert "must be of the same weights" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--objective", "speed=1"], "`objective` must be one of mean-torque, "),
        (["--objective", "spin"], "`--objective` must look like NAME=WEIGHT, but is 'spin'"),
        (["--iterations", "0"], "`--iterations` must be positive, but is 0"),
    ],
)
def test_bad_input(arguments, message, tmp_path, capsys):
    """One line, and nothing written."""
    folder = tmp_path / "design"
    assert main(["design", "baseline", "-o", str(folder), *arguments]) == 2
    assert message in capsys.readouterr().err
    assert not folder.exists()
