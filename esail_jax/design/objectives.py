"""What a design can aim at: numbers made of the observables of a run, to be made small.

Every objective is a function of a run. Means and variances are over time, by the trapezoidal rule over
the saved instants: over a whole turn the first and the last of them are one phase, and count once.
`of_run` divides an objective by its value without modulation, so that weights compare.

An objective that has numbers of its own carries them in its name, behind a colon: "spin-plane:15".
"""

import dataclasses
from collections.abc import Callable, Mapping

import jax.numpy as jnp

from esail_jax.array_types import Array, Float, Scalar
from esail_jax.joints.roots import rotation_about_y
from esail_jax.scenes.rules import SceneError
from esail_jax.simulation.simulate import Solution


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


def spin_plane(run: Solution, sailing_deg: float, precession_deg: float = 0.0, last: float = 0.0) -> Scalar:
    """Square of the distance of the spin plane's normal from the one with these sailing and precession
    angles [-], (sin alpha cos delta, sin alpha sin delta, cos alpha) in O: at the end, or its mean over the
    last seconds. Over the half turn that nutation takes, that is a plane that has come to rest. At least
    three tethers."""
    alpha, delta = jnp.deg2rad(sailing_deg), jnp.deg2rad(precession_deg)
    aim = jnp.stack([jnp.sin(alpha) * jnp.cos(delta), jnp.sin(alpha) * jnp.sin(delta), jnp.cos(alpha)])
    # The orbital frame, from the attitude that a run starts at (`starting_attitude`), alpha with its sign.
    start = run["sailing_angle"][0] * jnp.cos(run["precession_angle"][0])
    orbital = run["rotation_IB"][0] @ rotation_about_y(start - 0.5 * jnp.pi).T
    miss = ((plane_normals(run) - orbital @ aim) ** 2).sum(1)
    if last == 0.0:
        return miss[-1]
    # A microsecond for rounding of saved instants.
    since = run.time > run.time[-1] - last - 1e-6
    steps = jnp.where(since[:-1], jnp.diff(run.time), 0.0)
    return (steps * 0.5 * (miss[1:] + miss[:-1])).sum() / steps.sum()


def hub_swing(run: Solution) -> Scalar:
    """Mean square of the hub axis's distance from the spin plane's normal [-]. At least three tethers."""
    return mean(run, ((spin_axes(run) - plane_normals(run)) ** 2).sum(1))


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
    "hub-swing": hub_swing,
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

AIMED: dict[str, tuple[Callable[..., Scalar], int, int]] = {"spin-plane": (spin_plane, 1, 3)}
"""To be made small, with numbers behind a colon: at least and at most how many."""

NAMES = (*OBJECTIVES, *KEPT)
"""Of those without numbers."""


def function_of(name: str) -> Callable[[Solution], Scalar]:
    """The named number of a run. Raises SceneError for what is none."""
    if name in KEPT:
        return KEPT[name][0]
    if name in OBJECTIVES:
        return OBJECTIVES[name]
    kind, _, text = name.partition(":")
    if kind not in AIMED:
        known = ", ".join((*NAMES, *AIMED))
        raise SceneError("objective", f"be one of {known}", f"is {name!r}")
    function, least, most = AIMED[kind]
    try:
        aim = tuple(map(float, text.split(",")))
    except ValueError:
        aim = ()
    if not least <= len(aim) <= most:
        form = f"look like {kind}:15, {kind}:15,0 (degrees) or {kind}:15,0,800 (over the last seconds)"
        raise SceneError("objective", form, f"is {name!r}")
    return lambda run: function(run, *aim)


def values(run: Solution, names: tuple[str, ...]) -> dict[str, Scalar]:
    """The named numbers of a run."""
    rows = {name: jnp.asarray(x) for name, x in run.rows.items()}
    run = dataclasses.replace(run, time=jnp.asarray(run.time), rows=rows)
    return {name: function_of(name)(run) for name in names}


def of_run(run: Solution, weights: Mapping[str, float], before: Mapping[str, Scalar | float]) -> Scalar:
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


def plane_normals(run: Solution) -> Float[Array, "time 3"]:
    """Unit normal of the spin plane in I, on the side of X_B: the vector area of the polygon of the tips,
    sum_i (r_i - r_mean) x (r_{i+1} - r_mean)."""
    tips = run["tip_position_I"]
    offsets = tips - tips.mean(1, keepdims=True)
    area = jnp.cross(offsets, jnp.roll(offsets, -1, 1)).sum(1)
    normal = area / jnp.linalg.norm(area, axis=1, keepdims=True)
    side = jnp.sign((normal * spin_axes(run)).sum(1, keepdims=True))
    return side * normal
