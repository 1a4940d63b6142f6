"""What a design can aim at: numbers made of the observables of a run, to be made small.

Every objective is a function of a run. Means and variances are over time, by the trapezoidal rule over
the saved instants: over a whole turn the first and the last of them are one phase, and count once.
`of_run` divides an objective by its value without modulation, so that weights compare.
"""

import dataclasses
from collections.abc import Callable, Mapping

import jax.numpy as jnp

from esail_jax.array_types import Array, Float, Scalar
from esail_jax.simulate import Solution


def mean(run: Solution, values: Float[Array, "time *some"]) -> Float[Array, "*some"]:
    """Mean over time, trapezoidal rule."""
    length = run.time[-1] - run.time[0]
    return jnp.trapezoid(values, run.time, axis=0) / length


def variance(run: Solution, values: Float[Array, "time *some"]) -> Float[Array, "*some"]:
    """Mean square of the distance from the mean over time."""
    return mean(run, (values - mean(run, values)) ** 2)


def mean_torque(run: Solution) -> Scalar:
    """|mean over time of the thrust's moment across the spin axis|^2 [(N m)^2]: what turns that axis."""
    moment = mean(run, jnp.einsum("tib,tb->ti", run["rotation_IB"], run["thrust_moment_B"].sum(1)))
    axis = mean(run, spin_axes(run))
    axis = axis / jnp.linalg.norm(axis)
    return ((moment - axis * (axis @ moment)) ** 2).sum()


def attitude(run: Solution) -> Scalar:
    """Mean square of the spin axis's distance from where it starts [-]."""
    axes = spin_axes(run)
    return mean(run, ((axes - axes[:1]) ** 2).sum(1))


def final_attitude(run: Solution) -> Scalar:
    """Square of the spin axis's distance from where it starts, at the end [-]."""
    axes = spin_axes(run)
    return ((axes[-1] - axes[0]) ** 2).sum()


def lagging(run: Solution) -> Scalar:
    """Mean square of the tethers' lagging angles [rad^2]."""
    return mean(run, run["lagging_angle"] ** 2).mean()


def coning(run: Solution) -> Scalar:
    """Variance in time of the tethers' coning angles [rad^2]."""
    return variance(run, run["coning_angle"]).mean()


def spin(run: Solution) -> Scalar:
    """Variance in time of the hub's spin rate [(rad/s)^2]."""
    return variance(run, run["angular_velocity_B"][:, 0])


def hub_torque(run: Solution) -> Scalar:
    """Mean square of the moment of the reactions on the hub [(N m)^2]."""
    return mean(run, (run["reaction_moment_O"] ** 2).sum(1))


def power(run: Solution) -> Scalar:
    """Mean of V^(3/2) [V^(3/2)]: the current that keeps a tether at V grows with the root of V."""
    return mean(run, run["voltage"] ** 1.5).mean()


def thrust(run: Solution) -> Scalar:
    """Mean thrust [N]. Of this one, what is missing counts: see `of_run`."""
    return mean(run, jnp.linalg.norm(run["thrust_O"], axis=1))


def closeness(run: Solution) -> Scalar:
    """Inverse of the smallest distance [m] between tethers."""
    return 1.0 / run["smallest_tether_distance"].min()


OBJECTIVES: dict[str, Callable[[Solution], Scalar]] = {
    "mean-torque": mean_torque,
    "attitude": attitude,
    "final-attitude": final_attitude,
    "lagging": lagging,
    "coning": coning,
    "spin": spin,
    "hub-torque": hub_torque,
    "power": power,
    "closeness": closeness,
}
"""To be made small."""

KEPT = {"thrust": (thrust, 0.96)}
"""To be kept, with the part of its value without modulation below which it costs."""

NAMES = (*OBJECTIVES, *KEPT)


def values(run: Solution, names: tuple[str, ...]) -> dict[str, Scalar]:
    """The named numbers of a run."""
    rows = {name: jnp.asarray(x) for name, x in run.rows.items()}
    run = dataclasses.replace(run, time=jnp.asarray(run.time), rows=rows)
    functions = OBJECTIVES | {name: entry[0] for name, entry in KEPT.items()}
    return {name: functions[name](run) for name in names}


def of_run(run: Solution, weights: Mapping[str, float], before: Mapping[str, float]) -> Scalar:
    """sum_k w_k J_k / J_k(before), and w (0.96 - T / T(before))^2, in percents, where thrust is less."""
    total = jnp.zeros(())
    for name, value in values(run, tuple(weights)).items():
        part = value / before[name]
        if name in KEPT:
            part = (100.0 * jnp.maximum(KEPT[name][1] - part, 0.0)) ** 2
        total = total + weights[name] * part
    return total


def spin_axes(run: Solution) -> Float[Array, "time 3"]:
    """X_B in I, at every saved instant."""
    return run["rotation_IB"][:, :, 0]
