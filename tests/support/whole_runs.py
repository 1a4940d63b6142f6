"""Checks of whole runs that the tests of several methods share: derivatives, `vmap`, and resuming."""

import jax
import numpy as np

import esail_jax as esail
from esail_jax.cli import main
from support.quick import jit


def numbers(x):
    """Overrides of four numbers of the baseline; `x` holds the factor of each."""
    return {
        "voltage.value": 20e3 * x[0],
        "initial.spin_rate": 4e-3 * x[1],
        "remote_units.mass": 1.5 * x[2],
        "tethers.youngs_modulus": 70e9 * x[3],
    }


def check_derivative(outcome, weights, quotient_to, concrete_to):
    """Checks the derivative of `outcome` along one direction.

    outcome: maps the four factors of `numbers` to some numbers at the end of a run. Forward mode must
    agree with the fourth-order difference quotient of concrete runs (relative, to `quotient_to`). Reverse
    mode of the weighted sum must agree with forward mode (1e-10: rounding), and the traced run with the
    concrete run (to `concrete_to`).
    """
    one, along, weights = np.ones(4), np.array([1.0, 0.3, -0.2, 0.5]), np.array(weights)
    value, forward = jit(lambda x: jax.jvp(outcome, (x,), (along,)))(one)
    assert np.allclose(value, outcome(one), rtol=concrete_to, atol=0)
    e = 1e-3
    quotient = 8.0 * (outcome(one + e * along) - outcome(one - e * along))
    quotient = (quotient - (outcome(one + 2 * e * along) - outcome(one - 2 * e * along))) / (12.0 * e)
    assert np.allclose(forward, quotient, rtol=quotient_to, atol=0)
    reverse = jit(jax.grad(lambda x: weights @ outcome(x)))(one)
    assert abs(reverse @ along / (weights @ forward) - 1.0) < 1e-10


def check_going_on(overrides, first, end, folder):
    """A run file of the baseline that is continued from `first` [s] to `end` [s] is bit-identical to that
    of one run to `end`."""
    settings = [x for k, v in overrides.items() if k != "integrator.t_end" for x in ("--set", f"{k}={v}")]
    check_resumed_bits("baseline", (first, end), folder, *settings)


def check_resumed_bits(scene, ends, folder, *options):
    """Checks that a run to the first of `ends` [s], continued from its file to each of the others, is bit
    for bit the run that goes to the last of them at once. Returns this run.

    scene: name or path, as for the command; options: further ones of the command."""
    once, twice = folder / "once.h5", folder / "twice.h5"

    def run(path, end, *more):
        command = ("run", scene, *options, "-o", path, "--t-end", end, "--quiet", *more)
        assert main([str(x) for x in command]) == 0

    run(once, ends[-1])
    run(twice, ends[0])
    for end in ends[1:]:
        run(twice, end, "--resume")
    one, other = esail.load(once), esail.load(twice)
    assert np.array_equal(one.time, other.time)
    for name in one.observables:
        assert np.array_equal(one[name], other[name], equal_nan=True), name
    return one
