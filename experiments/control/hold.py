"""The sailing angle held at 15 deg for a day: gains tuned by gradient, a network trained through the run,
the package's feedback, and constant voltages, in winds that the tuning has not seen.

    python experiments/control/hold.py

writes hold.csv, hold.png, gradient.csv and training.csv.
"""

import time
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from laws import Policy, Steering
from matplotlib.figure import Figure
from sail import CONSTANT, DAY, SAVED, TURN, circumstance, miss, sail
from tables import write

import esail_jax as esail
from esail_jax import control

HERE = Path(__file__).parent
TRAINING, UNSEEN = range(100, 104), range(6)
EFFORT, LAG = 1e-5, 1e-3
"""Weights of the mean squares of the relative change of voltage and of the lagging angle [rad], beside the
mean square of the miss [rad]."""

NOISE = {"momentum_axis": 1e-3, "chords": 1e-3, "tip_velocity": 0.01, "root_tension": 0.002}
"""Standard deviations of the sensors in the runs of a day: some 0.06 deg for directions."""


def cost(law, given, duration):
    """Mean square of the miss plus effort, over a run that starts one degree off its aim."""
    run = esail.simulate("baseline", sail(duration, interval=60.0) | given, voltage_law=law, save=SAVED)
    change = run["voltage"] / 20e3 - 1.0
    lag = jnp.mean(run["lagging_angle"] ** 2)
    return jnp.mean(miss(run) ** 2) + EFFORT * jnp.mean(change**2) + LAG * lag


def trainer(law, duration):
    """The cost of a law and its gradient, compiled once for all circumstances."""
    numbers, others = eqx.partition(law, eqx.is_array)

    def value(x, given, seed):
        return cost(control.Noisy(eqx.combine(x, others), NOISE, seed), given, duration)

    of = esail.jit(jax.value_and_grad(value))
    return numbers, lambda x: eqx.combine(x, others), of


def train(law, duration, steps, rate, seeds):
    """Adam on the mean cost over the training circumstances, in each of which every step sees other noise
    of the sensors. Returns the law with the least cost."""
    numbers, whole, of = trainer(law, duration)
    optimiser = optax.adam(rate)
    state, best, history = optimiser.init(numbers), (np.inf, numbers), []
    given = [jax.tree.map(jnp.asarray, circumstance(seed, duration)) for seed in seeds]
    for step in range(steps):
        began = time.perf_counter()
        found = [of(numbers, one, jnp.asarray(1000 * step + i)) for i, one in enumerate(given)]
        value = float(np.mean([x for x, _ in found]))
        gradient = jax.tree.map(lambda *x: sum(x) / len(x), *(g for _, g in found))
        if value < best[0]:
            best = value, numbers
        history.append((step, value, time.perf_counter() - began))
        updates, state = optimiser.update(gradient, state)
        numbers = optax.apply_updates(numbers, updates)
    return whole(best[1]), history


def tuned_steering():
    """The three gains of the steering law, tuned in their logarithms."""

    class Logarithms(eqx.Module):
        logs: jax.Array
        period: float = eqx.field(static=True, default=60.0)

        def law(self):
            return Steering(*jnp.exp(self.logs))

        def init(self, measurements):
            return self.law().init(measurements)

        def update(self, measurements, memory):
            return self.law().update(measurements, memory)

    found, history = train(Logarithms(jnp.log(jnp.array([0.5, 0.05, 0.05]))), 3 * TURN, 40, 0.25, TRAINING)
    return found.law(), history


def day(law, overrides, seed, noise):
    """One day in one circumstance. Returns the rms of the miss in the last 18 hours [deg], and the run."""
    if law is not None and noise:
        law = control.Noisy(law, NOISE, seed)
    given = sail(DAY) | circumstance(seed, DAY) | overrides
    run = esail.simulate("baseline", given, voltage_law=law, save=SAVED)
    off = np.rad2deg(miss(run))
    return float(np.sqrt((off[run.time > 6 * 3600.0] ** 2).mean())), run, off


def gradient_cost(law):
    """Growth of the gradient with the horizon, and its price beside the run itself and the open loop."""
    rows = []
    for turns in (1, 3, 6, 12):
        duration = turns * TURN
        numbers, whole, of = trainer(law, duration)
        given = jax.tree.map(jnp.asarray, circumstance(100, duration)), jnp.asarray(1)
        value = esail.jit(lambda x, g, seed: cost(control.Noisy(whole(x), NOISE, seed), g, duration))  # noqa: B023
        seconds = []
        for function in (value, of):
            jax.block_until_ready(function(numbers, *given))
            began = time.perf_counter()
            for _ in range(3):
                found = jax.block_until_ready(function(numbers, *given))
            seconds.append((time.perf_counter() - began) / 3)
        slope = found[1].gain
        e = 1e-3 * float(numbers.gain)
        ends = [
            float(value(eqx.tree_at(lambda n: n.gain, numbers, numbers.gain + x), *given))
            for x in (-2 * e, -e, e, 2 * e)
        ]
        quotient = (8 * (ends[2] - ends[1]) - (ends[3] - ends[0])) / (12 * e)
        apart = open_loop(duration, given)
        rows.append((turns, float(found[0]), float(slope), float(slope) / quotient - 1.0, *seconds, *apart))
        print("gradient", rows[-1], flush=True)
    return rows


def open_loop(duration, given):
    """Seconds of the run with constant voltages, and of its gradient by them, in the same circumstance."""

    def of_volts(volts, given, seed):
        scene = sail(duration, interval=60.0) | given | CONSTANT | {"voltage.value": volts}
        run = esail.simulate("baseline", scene, save=SAVED)
        return jnp.mean(miss(run) ** 2) + LAG * jnp.mean(run["lagging_angle"] ** 2)

    seconds, volts = [], jnp.full(4, 20e3)
    for function in (esail.jit(of_volts), esail.jit(jax.grad(of_volts))):
        assert np.isfinite(function(volts, *given)).all()
        began = time.perf_counter()
        for _ in range(3):
            jax.block_until_ready(function(volts, *given))
        seconds.append((time.perf_counter() - began) / 3)
    return seconds


def main():
    steering, history = tuned_steering()
    print("steering", steering, history[0], history[-1], flush=True)
    start = Policy(steering, 8, jax.random.key(0))
    policy, learning = train(start, 3 * TURN, 80, 2e-3, TRAINING)
    print("policy", learning[0], learning[-1], flush=True)
    feedback = {
        "voltage.law": "feedback", "voltage.gain": 0.5, "voltage.target_sailing_angle_deg": 15.0,
        "voltage.measured_axis": "angular-momentum",
    }  # fmt: skip
    strong = feedback | {"voltage.gain": float(steering.gain)}
    untuned = Steering(*jnp.array([0.5, 0.0, 0.0]))
    laws = {
        "constant voltage": (None, CONSTANT),
        "feedback, gain 0.5": (None, feedback),
        "feedback, tuned gain": (None, strong),
        "steering, gain 0.5": (untuned, {}),
        "steering, tuned": (steering, {}),
        "network": (policy, {}),
    }
    print(policy.steering.gain, policy.steering.integral, policy.steering.damping)
    table, lines = [], {}
    for name, (law, overrides) in laws.items():
        for noise in (False, True)[: 1 if law is None else 2]:
            found = [day(law, overrides, seed, noise) for seed in UNSEEN]
            rms = np.array([x for x, *_ in found])
            change = [np.sqrt(np.mean((run["voltage"] / 20e3 - 1.0) ** 2)) for _, run, _ in found]
            swing = np.rad2deg(max(np.abs(run["lagging_angle"]).max() for _, run, _ in found))
            label = name + ", noisy sensors" * noise
            table.append((label, rms.mean(), rms.max(), np.mean(change), swing))
            lines[label] = found[0][1].time / 3600.0, found[0][2]
            print(table[-1], flush=True)
    write(
        "hold.csv",
        ("law", "mean rms [deg]", "worst rms [deg]", "rms voltage change", "largest lag [deg]"),
        table,
    )
    write(
        "training.csv",
        ("law", "step", "cost", "seconds"),
        [(n, *x) for n, h in (("steering", history), ("network", learning)) for x in h],
    )
    write(
        "gradient.csv",
        (
            "turns",
            "cost",
            "by gain",
            "relative error",
            "run [s]",
            "with gradient [s]",
            "open loop [s]",
            "with gradient [s]",
        ),
        gradient_cost(Steering(*jnp.array([0.5, 0.05, 0.05]))),
    )
    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    axes = figure.subplots()
    for (label, (hours, off)), style in zip(
        lines.items(), ("k:", "C0-", "C1-", "C2-", "C2--", "C3-", "C3--", "C4-", "C4--"), strict=True
    ):
        axes.semilogy(hours, np.maximum(off, 1e-3), style, label=label, lw=1.0)
    axes.set(xlabel="time [h]", ylabel="angle to the aim [deg]", xlim=(0, 24))
    figure.legend(fontsize=7, ncols=3, loc="outside lower center")
    figure.savefig(HERE / "hold.png", dpi=150)


if __name__ == "__main__":
    main()
