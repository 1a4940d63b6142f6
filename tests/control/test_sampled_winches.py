"""Laws of winches with a control period: the tension of every motor is held between two samples."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.array_types import Array
from esail_jax.cli import main
from esail_jax.physics import WinchLaw
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.structure import split
from esail_jax.scenes.toml_text import to_toml
from esail_jax.simulation.law_jumps import watched
from esail_jax.simulation.sampling import sample
from esail_jax.simulation.schedule import sampling_instants, switch_times
from esail_jax.steppers.stepper import Point
from support.bits import check_same, esail_run
from support.derivatives import check_both_modes
from support.quick import build_jitted, jit
from support.winch_sail import UNEQUAL, WITHOUT_TABLE

NAMES = ["deployed_length", "payout_rate", "winch_tension", "lagging_angle"]
SHORT = WITHOUT_TABLE | {"integrator.t_end": 20.0, "output.interval": 2.5, "integrator.tolerance": 1e-12}


class Servo(WinchLaw):
    """A digital servo that holds a rate [m/s] with a gain [N s/m]. It learns the tension by the integral of
    the error, with a second gain [N/m]."""

    rate: Array
    gain: Array
    learning: Array
    period: float = eqx.field(static=True, default=5.0)

    def init(self, measurements):
        return {"learned": measurements.root_tension, "samples": 0}

    def update(self, measurements, memory):
        error = measurements.payout_rate - self.rate
        learned = memory["learned"] + self.learning * self.period * error
        return learned + self.gain * error, {"learned": learned, "samples": memory["samples"] + 1}


class Proportional(WinchLaw):
    """A digital servo without a memory."""

    rate: Array
    gain: Array
    period: float = eqx.field(static=True, default=5.0)

    def tension(self, measurements):
        return 0.1 + self.gain * (measurements.payout_rate - self.rate)


class Held(WinchLaw):
    """Motors that hold tensions [N]."""

    newtons: Array

    def tension(self, measurements):
        return self.newtons


class Alternating(WinchLaw):
    """Tensions that change from sample to sample, whatever is measured."""

    newtons: Array
    period: float = eqx.field(static=True, default=5.0)

    def init(self, measurements):
        return jnp.ones(())

    def update(self, measurements, memory):
        return self.newtons * (1.0 + 0.2 * memory), -memory


def servo(**changed):
    numbers = {"rate": 0.3, "gain": 0.05, "learning": 0.01} | changed
    return Servo(*(jnp.asarray(x) for x in numbers.values()))


def test_samples_are_held_and_remembered():
    """The second sample follows from the memory of the first; between the two, motors hold the first, to
    which the tension of a law that is not sampled is added."""
    law, steady = Alternating(jnp.array([0.1, 0.12])), Held(jnp.array([0.01, 0.02]))
    scene = load_scene("truss", WITHOUT_TABLE | {"terms": [steady, law]})
    assert split(scene)[0].is_sampled and split(scene)[0].is_switched
    assert switch_times(scene, 12.0) == (5.0, 10.0) and sampling_instants(scene, 12.0) == (5.0, 10.0)
    assert watched_of(scene) == 1 and watched_of(scene.replace({"terms": [law]})) == 0
    system, q, v, *_ = build_jitted(*split(scene))

    @jit
    def held(q, v):
        start = Point(jnp.zeros(()), q, v, system.no_power, jnp.asarray(True))
        one = sample(system, start, None)
        two = sample(system, start, one)
        return [x.held_by(system).motor_tension(start.time, q, v) for x in (one, two)]

    one, two = held(q, v)
    np.testing.assert_allclose(one, [0.13, 0.164], rtol=1e-15)
    np.testing.assert_allclose(two, [0.09, 0.116], rtol=1e-15)


def watched_of(scene):
    """The number of laws whose jumps are looked for."""
    return len(watched(build_jitted(*split(scene)).system))


@pytest.mark.nightly
@pytest.mark.parametrize("method", ["collocation", "generalized-alpha"])
def test_a_sampled_law_is_a_sequence_of_runs_with_constant_tensions(method):
    """Each of 5 s, from where the one before ended. A row at a sampling instant has the tension before the
    sample: to 1e-9 of the range, what the end of a run is projected by."""
    scene = SHORT if method == "collocation" else SHORT | {
        "integrator.tolerance": None, "integrator.step": 0.05, "integrator.method": method}  # fmt: skip
    whole = esail.simulate("truss", scene, terms=[Alternating(jnp.array([0.1, 0.12]))], save=NAMES)
    rows, start = [], None
    for part in range(4):
        held = Held((1.2 if part % 2 == 0 else 0.8) * jnp.array([0.1, 0.12]))
        times = [5.0 * part + x for x in (2.5, 5.0)]
        run = esail.simulate("truss", scene, terms=[held], save=NAMES, start=start, times=times)
        rows.append({name: run[name] for name in NAMES})
        start = run.final_state
    for name in NAMES:
        expected = np.concatenate([part[name] for part in rows])
        error = np.abs(whole[name][1:] - expected).max() / np.ptp(expected)
        assert error < (1e-9 if method == "collocation" else 1e-7), name


@pytest.mark.nightly
def test_a_law_with_a_memory_holds_the_rate():
    """The integral of the error finds the tension that the rate needs, and falls behind by what this
    tension changes by in a second, over the second gain: 1 to 3 % of the rate, to a tenth of that. The
    mirror image has the same lengths, to 1e-6 of their range."""
    long = SHORT | {"integrator.t_end": 400.0, "output.interval": 20.0, "integrator.tolerance": 1e-9}
    law = servo(rate=0.1, gain=0.2, learning=0.04)
    run, image = (
        esail.simulate("truss", long | {"initial.spin_rate": spin}, terms=[law], save=NAMES)
        for spin in (0.06, -0.06)
    )
    behind = run["payout_rate"][-1] - 0.1
    tension = run["winch_tension"][-3:]
    assert np.all(np.abs(behind) < 3e-3)
    np.testing.assert_allclose(behind, (tension[2] - tension[0]) / 40.0 / 0.04, rtol=0.1)
    drift = np.abs(run["deployed_length"] - image["deployed_length"]).max()
    assert drift < 1e-6 * np.ptp(run["deployed_length"])


@pytest.mark.nightly
def test_it_shares_its_clock_with_a_voltage_law():
    """Each law holds what it holds alone: with a wind that does not push, lengths are those of the winch
    law alone, and voltages are those of the voltage law."""

    class Ramp(eqx.Module):
        period: float = eqx.field(static=True, default=5.0)

        def init(self, measurements):
            return jnp.zeros(())

        def update(self, measurements, memory):
            return 10.0 * memory, memory + 1.0

    scene = {key: x for key, x in SHORT.items() if key not in ("solar_wind", "voltage")}
    law, names = Alternating(jnp.array([0.1, 0.12])), [*NAMES, "voltage"]
    both = esail.simulate("truss", scene, terms=[law], voltage_law=Ramp(), save=names)
    alone = esail.simulate("truss", SHORT, terms=[law], save=NAMES)
    assert np.array_equal(both["voltage"][:, 0], [0, 0, 0, 10, 10, 20, 20, 30, 30])
    for name in NAMES[:3]:
        assert np.abs(both[name] - alone[name]).max() < 1e-7 * np.ptp(alone[name])


@pytest.mark.nightly
def test_derivatives_and_batches():
    """By the numbers of the law and the spin, through samples and memory: reverse against forward mode, and
    forward mode against differences; the derivative of a gradient, and a batch of gradients."""
    numbers = {"rate": (0.3, 1e-4), "gain": (0.05, 1e-5), "learning": (0.01, 1e-5),
               "initial.spin_rate": (0.06, 1e-5)}  # fmt: skip

    short = SHORT | {"integrator.t_end": 12.0, "output.interval": 6.0}

    def signals(given):
        of_scene = {key: x for key, x in given.items() if "." in key}
        law = servo(**{key: x for key, x in given.items() if key not in of_scene})
        run = esail.simulate("truss", short | of_scene, terms=[law], max_steps=1000)
        return {name: run[name] for name in ("deployed_length", "payout_rate")}

    for (key, name), error in check_both_modes(signals, numbers).items():
        assert error < 1e-6, (key, name)

    def last(gain):
        run = esail.simulate("truss", short, terms=[servo(gain=gain)], save=NAMES[:1], max_steps=1000)
        return run["deployed_length"][-1].sum()

    slope = esail.jit(jax.grad(last))
    second = esail.jit(jax.grad(jax.grad(last)))(0.05)
    assert abs(second - (slope(0.051) - slope(0.049)) / 2e-3) < 1e-5 * abs(second)
    batch = esail.jit(jax.vmap(jax.grad(last)))(jnp.array([0.04, 0.05]))
    assert np.allclose(batch, [slope(0.04), slope(0.05)], rtol=1e-9)


LAWS = """
import equinox as eqx
import jax.numpy as jnp
from esail_jax.cli import main
from esail_jax.physics import WinchLaw

class Law(WinchLaw):
    period: float = eqx.field(static=True, default=7.0)

    def init(self, measurements):
        return {"learned": measurements.root_tension, "count": 0}

    def update(self, measurements, memory):
        error = measurements.payout_rate - 0.2
        learned = memory["learned"] + 0.02 * error
        return learned + 0.05 * error, {"learned": learned, "count": memory["count"] + 1}

law = Law()
"""


@pytest.mark.nightly
def test_a_run_is_resumed_bit_for_bit(tmp_path, capsys):
    """The held tensions and the memory are those of the file, between two samples. The scene has no table
    of tensions: without the terms its text alone is none."""
    scene, law, whole, parts = (tmp_path / name for name in ("a.toml", "law.py", "whole.h5", "parts.h5"))
    table = {"deployment.tension": [0.0, 0.0], "deployment.time": [0.0, 1.0]}
    text = to_toml(load_scene("truss", SHORT | table))
    scene.write_text(text.replace("time = [0.0, 1.0]\n", "").replace("tension = [0.0, 0.0]\n", ""))
    law.write_text(LAWS)
    own = ("--terms", f"{law}:law")
    assert esail_run(scene, whole, *own) == 0
    assert esail_run(scene, parts, *own, "--t-end", "10") == 0
    assert esail_run(scene, parts, *own, "--resume") == 0
    check_same(parts, whole)
    assert main(["info", str(whole)]) == 0 and "2 tethers" in capsys.readouterr().out


class Nothing(WinchLaw):
    """A law without a method."""


class Both(Servo):
    """A law with both sets of methods."""

    def tension(self, measurements):
        return 0.0


class Unclocked(WinchLaw):
    """A memory without a period."""

    def init(self, measurements):
        return jnp.zeros(())

    def update(self, measurements, memory):
        return 0.1, memory


class Growing(Alternating):
    """A memory that grows."""

    def update(self, measurements, memory):
        return self.newtons, jnp.stack([memory, memory])


class Alone(Alternating):
    """One thing where two are asked for."""

    def update(self, measurements, memory):
        return self.newtons


class Wild(Alternating):
    """Tensions that are not finite."""

    def update(self, measurements, memory):
        return self.newtons / 0.0, memory


class Volts(eqx.Module):
    period: float = eqx.field(static=True, default=4.0)

    def commanded(self, measurements):
        return 1e3


ONE = jnp.ones(2)


@pytest.mark.parametrize(
    ("laws", "message"),
    [
        ([Nothing()], r"`terms\[0\]` must have the method `tension`, or the methods `init` and"),
        ([Both(ONE, ONE, ONE)], r"`terms\[0\]` must have the method .* but Both has tension and init and"),
        ([Unclocked()], r"`terms\[0\].period` must be given for a law with `update`, but is missing"),
        ([Alternating(ONE, 0.0)], r"`terms\[0\].period` must be positive, but is 0.0"),
        ([Alternating(ONE, "5")], r"`terms\[0\].period` must be positive, but is '5'"),
        ([Alternating(ONE), Alternating(ONE, 3.0)], r"`terms\[1\].period` must be that of `terms\[0\]"),
        ([Alternating(ONE, 1e-9)], r"`terms\[0\].period` must leave at most"),
        ([Growing(ONE)], r"Growing\).update` must return a memory like the one before"),
        ([Alone(ONE)], r"Alone\).update` must return two things, the tensions and the next memory"),
        ([Wild(ONE)], r"Wild\).update` must be finite"),
        ([Alternating(jnp.ones(3))], r"Alternating\).update` must return numbers of newtons"),
    ],
)  # fmt: skip
def test_what_is_refused(laws, message):
    """In one line that names the law, before anything is computed."""
    with pytest.raises(esail.SceneError, match=message):
        esail.simulate("truss", WITHOUT_TABLE, terms=laws)


def test_laws_of_one_scene_have_one_clock():
    windy = {key: x for key, x in UNEQUAL.items() if key not in ("solar_wind", "voltage")}
    with pytest.raises(
        esail.SceneError, match=r"`terms\[0\].period` must be that of `voltage_law.period`, 4"
    ):
        esail.simulate("truss", windy, terms=[Alternating(ONE)], voltage_law=Volts())


def test_the_period_of_another_term_is_its_own():
    """Only laws of winches are sampled: other terms may have a number of that name."""
    from esail_jax.physics import TipLoad
    from esail_jax.scenes.control_period import control_periods

    class Swing(TipLoad):
        period: float = 8.0

        def force(self, measurements):
            return jnp.zeros((3, 2))

    scene = load_scene("truss", WITHOUT_TABLE | {"terms": [Swing(), Held(ONE)]})
    assert control_periods(scene) == {}
