"""Objectives of a design: numbers made of the observables of a run, to be made small.

Every objective is a function of a run. Means and variances over time use the trapezoidal rule over the
saved instants. Over a whole turn the first and last instants have the same phase; the rule gives each
half weight. `weighted_sum` divides every objective but limits by its value at constant voltage, so that
weights are comparable.

An objective with parameters carries them in its name, after a colon: "spin-plane:15".
"""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float, Scalar
from esail_jax.numerics.angles import rotation_of
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.scene import Scene
from esail_jax.simulation.solution import Solution


def mean(run: Solution, values: Float[Array | np.ndarray, "time *some"]) -> Float[Array, "*some"]:
    """Mean over time, by the trapezoidal rule."""
    length = run.time[-1] - run.time[0]
    return jnp.trapezoid(values, run.time, axis=0) / length


def variance(run: Solution, values: Float[Array | np.ndarray, "time *some"]) -> Float[Array, "*some"]:
    """Variance over time."""
    return mean(run, (values - mean(run, values)) ** 2)


def mean_torque(run: Solution) -> Scalar:
    """Square of the thrust's mean moment m normal to the mean spin axis n, |m - (m . n) n|^2 [(N m)^2].

    This moment turns the spin axis."""
    moment = mean(run, jnp.einsum("tib,tb->ti", run["rotation_IB"], run["thrust_moment_B"].sum(1)))
    axis = mean(run, spin_axes(run))
    axis = axis / jnp.linalg.norm(axis)
    return ((moment - axis * (axis @ moment)) ** 2).sum()


def attitude(run: Solution) -> Scalar:
    """Mean square of the distance between the spin axis and its start, mean |n(t) - n(0)|^2 [-]."""
    axes = spin_axes(run)
    return mean(run, ((axes - axes[:1]) ** 2).sum(1))


def final_attitude(run: Solution) -> Scalar:
    """Square of the distance between the spin axis at the end and its start, |n(T) - n(0)|^2 [-]."""
    axes = spin_axes(run)
    return ((axes[-1] - axes[0]) ** 2).sum()


def spin_plane(run: Solution, sailing_deg: float, precession_deg: float = 0.0, last: float = 0.0) -> Scalar:
    """Square of the distance of the spin plane's normal s at the end from a target s_0, |s - s_0|^2 [-].

    The target has a sailing angle alpha and a precession angle delta [deg]: in the orbital frame O it is
    (sin alpha cos delta, sin alpha sin delta, cos alpha). last: 0 takes the end of the run; otherwise the
    mean over the last `last` seconds. A small mean over half a turn, the period of the nutation, means
    that the plane has come to rest. It needs a hub and at least three tethers. O is that of the first
    saved instant: the attitude of the hub in I times the inverse of its attitude in O."""
    alpha, delta = jnp.deg2rad(sailing_deg), jnp.deg2rad(precession_deg)
    aim = jnp.stack([jnp.sin(alpha) * jnp.cos(delta), jnp.sin(alpha) * jnp.sin(delta), jnp.cos(alpha)])
    orbital = run["rotation_IB"][0] @ rotation_of(run["euler_hub"][0]).T
    squared = ((plane_normals(run) - orbital @ aim) ** 2).sum(1)
    if last == 0.0:
        return squared[-1]
    duration = run.time[-1] - run.time[0]
    if not isinstance(duration, jax.core.Tracer) and last > duration + 1e-6:
        got = f"asks for {last:g} s of a run of {float(duration):g} s"
        raise SceneError("objective", "average over at most the whole run", got)
    # A microsecond allows for rounding of the saved instants.
    since = run.time > run.time[-1] - last - 1e-6
    steps = jnp.where(since[:-1], jnp.diff(run.time), 0.0)
    return (steps * 0.5 * (squared[1:] + squared[:-1])).sum() / steps.sum()


def hub_swing(run: Solution) -> Scalar:
    """Mean square distance of the hub's axis n from the spin plane's normal s, mean |n - s|^2 [-].

    It needs at least three tethers."""
    return mean(run, ((spin_axes(run) - plane_normals(run)) ** 2).sum(1))


def lagging(run: Solution) -> Scalar:
    """Mean square of the lagging angle over time and tethers, mean beta^2 [rad^2]."""
    return mean(run, run["lagging_angle"] ** 2).mean()


def coning(run: Solution) -> Scalar:
    """Variance in time of the coning angle, in the mean over the tethers, var gamma [rad^2]."""
    return variance(run, run["coning_angle"]).mean()


def spin(run: Solution) -> Scalar:
    """Variance in time of the hub's spin rate, var omega_x [(rad/s)^2]."""
    return variance(run, run["angular_velocity_B"][:, 0])


def hub_torque(run: Solution) -> Scalar:
    """Mean square of the moment of the reactions between hub and tethers, mean |M|^2 [(N m)^2]."""
    return mean(run, (run["reaction_moment_O"] ** 2).sum(1))


def power(run: Solution) -> Scalar:
    """Mean electric power of all tethers, mean P_el [W].

    A scene without `tethers.wire_radius` has no electric power: there it is the mean of V^(3/2) over time
    and tethers [V^(3/2)], which is proportional to the power in a steady wind, because the current grows
    with the root of V. The ratio to constant voltage is then the same. A tether at a negative voltage
    collects no electrons and counts as zero."""
    if "electric_power" in run.observables:
        return mean(run, run["electric_power"])
    return mean(run, jnp.maximum(run["voltage"], 0.0) ** 1.5).mean()


def thrust(run: Solution) -> Scalar:
    """Mean size of the sail's thrust, mean |F_c| [N].

    It is retained, not made small: it costs (100 max(0.96 - x, 0))^2, where x is its ratio to constant
    voltage."""
    return mean(run, jnp.linalg.norm(run["thrust_O"], axis=1))


def closeness(run: Solution) -> Scalar:
    """Inverse of the smallest distance between two tethers in the whole run, 1 / min d [1/m]."""
    return 1.0 / run["smallest_tether_distance"].min()


def tension(run: Solution, least: float, most: float = np.inf) -> Scalar:
    """Square of the percentages by which the forces between hub and tethers leave their limits, 0 within
    them [%^2].

        (100 max(1 - min T / T_least, 0))^2 + (100 max(max T / T_most - 1, 0))^2

    with the least and the largest force T = |lambda_i| of all tethers and saved instants. A lower limit of
    0 is none. A released tether has no tension."""
    squared = (run["reaction_B"] ** 2).sum(-1)
    # The root of zero has no derivative: 1e-12 N is far below the tension of any tether.
    forces = jnp.sqrt(jnp.maximum(squared, 1e-24))
    below = jnp.zeros(()) if least == 0.0 else jnp.maximum(1.0 - forces.min() / least, 0.0)
    above = jnp.maximum(forces.max() / most - 1.0, 0.0)
    return (100.0 * below) ** 2 + (100.0 * above) ** 2


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
"""Objectives to be made small, by name."""

RETAINED = {"thrust": (thrust, 0.96)}
"""Objectives to be retained: the function, and the part of its value at constant voltage below which it
costs."""


class Parametrised(NamedTuple):
    """An objective with numbers after a colon: its function of a run and of these; the least and the
    largest number of them; whether finite ones suit; and what a message says of their form."""

    function: Callable[..., Scalar]
    least: int
    most: int
    suit: Callable[..., bool]
    form: str


PARAMETRISED = {
    "spin-plane": Parametrised(
        spin_plane, 1, 3, lambda sailing, precession=0.0, last=0.0: last >= 0.0,
        "spin-plane:15, spin-plane:15,0 (degrees) or spin-plane:15,0,800 (over the last seconds)",
    ),
    "tension": Parametrised(
        tension, 1, 2, lambda least, most=np.inf: 0.0 <= least < most and (least, most) != (0.0, np.inf),
        "tension:0.01 (at least, N) or tension:0.01,0.02 (at least and at most)",
    ),
}  # fmt: skip
"""Objectives with parameters."""

LIMITS = ("tension",)
"""Objectives that are zero within limits: they are not divided by their value at constant voltage."""

NAMES = (*OBJECTIVES, *RETAINED)
"""Names of the objectives without parameters."""


@runtime_checkable
class SceneGoal(Protocol):
    """An objective to be made small that follows from the scene of a run and not from the run alone, such
    as what its measurements would tell (`identification/goal.py`)."""

    def check(self, scene: Scene) -> None:
        """Raises SceneError for a scene that does not suit, before anything is run."""

    def of_scene(self, scene: Scene) -> Scalar:
        """The objective of the run of a scene, whose numbers may be traced."""
        ...


Goal = str | Callable[[Solution], Scalar] | SceneGoal
"""The name of an objective to be made small or to be retained, or a function of a run or an objective of a
scene to be made small."""


def function_of(name: Goal) -> Callable[[Solution], Scalar]:
    """The function of a run that a name stands for; a function stands for itself. Raises SceneError for an
    unknown name."""
    if isinstance(name, SceneGoal):
        raise TypeError(f"{name_of(name)} is an objective of a scene, not of a run")
    if not isinstance(name, str):
        return name
    if name in RETAINED:
        return RETAINED[name][0]
    if name in OBJECTIVES:
        return OBJECTIVES[name]
    kind, _, text = name.partition(":")
    if kind not in PARAMETRISED:
        known = ", ".join((*NAMES, *PARAMETRISED))
        raise SceneError("objective", f"be one of {known}", f"is {name!r}")
    function, least, most, suit, form = PARAMETRISED[kind]
    try:
        aim = tuple(map(float, text.split(",")))
    except ValueError:
        aim = ()
    if not least <= len(aim) <= most or not np.isfinite(aim).all() or not suit(*aim):
        raise SceneError("objective", f"look like {form}", f"is {name!r}")
    return lambda run: function(run, *aim)


def values(
    run: Solution, names: tuple[Goal, ...], scene: Scene | None = None
) -> dict[Goal, Scalar | float]:
    """Values of the named objectives of a run. scene: that of the run, if the run has none because it was
    traced. Raises SceneError for a function that gives no number, and for an observable that the run
    lacks."""
    scene = run.scene if scene is None else scene
    rows = {name: jnp.asarray(x) for name, x in run.observables.items()}
    run = dataclasses.replace(run, time=jnp.asarray(run.time), observables=rows)
    return {
        name: one_number(name, name.of_scene(scene) if isinstance(name, SceneGoal) else measured(name, run))
        for name in names
    }


def measured(name: Goal, run: Solution) -> Any:
    """The value of an objective. Raises SceneError for one of this module whose observables the run lacks;
    errors in a function of the user's stay as they are."""
    try:
        return function_of(name)(run)
    except KeyError as error:
        if not isinstance(name, str):
            raise
        raise SceneError("objective", "measure what the run has", f"{name}: {error.args[0]}") from error


def name_of(goal: Goal) -> str:
    """What a message calls an objective."""
    return goal if isinstance(goal, str) else getattr(goal, "__name__", type(goal).__name__)


def one_number(goal: Goal, value: Any) -> Any:
    """The value of an objective. Raises SceneError unless it is one real number."""
    must, who = "return one number", name_of(goal)
    if not isinstance(value, jax.Array | np.ndarray | np.generic | int | float):
        raise SceneError("objective", must, f"{who} returned a {type(value).__name__}")
    if np.shape(value):
        raise SceneError("objective", must, f"{who} returned an array of shape {np.shape(value)}")
    return value


LEAST_REFERENCE = 1e-20
"""Values of an objective of this module that count as zero, in its unit. Rounding of a run makes values of
at most 1e-23; those of the sail of `appendix-d`, 0.01 deg from the wind, are above 1e-15."""


def reference_of(goal: Goal, value: float) -> float:
    """What an objective is divided by: its value at constant voltage, or 1 for a limit. Raises SceneError
    for a value that it cannot be divided by: one that is zero but for rounding, negative, infinite or
    undefined."""
    if isinstance(goal, str) and goal.partition(":")[0] in LIMITS:
        return 1.0
    least = LEAST_REFERENCE if isinstance(goal, str) else 0.0
    if not (value > least and np.isfinite(value)):
        above = f"above {least:g}, which is rounding," if 0.0 < value <= least else "positive"
        must = f"be {above} at constant voltage, by which it is divided"
        raise SceneError("objective", must, f"{name_of(goal)} is {value:.3g}")
    return value


def weighted_sum(
    run: Solution,
    weights: Mapping[Goal, float],
    references: Mapping[Goal, Scalar | float],
    scene: Scene | None = None,
) -> Scalar:
    """sum_k w_k c_k(J_k / R_k), where R_k are the references and c_k(x) = x for an objective to be made
    small. scene: that of the run, as for `values`.

    For one to be retained c_k(x) = (100 max(part - x, 0))^2: the square of the percentage that is missing
    to `part` (0.96 for thrust)."""
    total = jnp.zeros(())
    for name, value in values(run, tuple(weights), scene).items():
        ratio = value / references[name]
        if name in RETAINED:
            ratio = (100.0 * jnp.maximum(RETAINED[name][1] - ratio, 0.0)) ** 2
        total = total + weights[name] * ratio
    return total


def spin_axes(run: Solution) -> Float[Array | np.ndarray, "time 3"]:
    """The spin axis X_B in I, at every saved instant."""
    return run["rotation_IB"][:, :, 0]


def plane_normals(run: Solution) -> Float[Array, "time 3"]:
    """Unit normal of the spin plane in I, on the side of X_B, at every saved instant.

    Its direction is the vector area of the polygon of the tips, sum_i (r_i - r_mean) x (r_{i+1} -
    r_mean)."""
    tips = run["tip_position_I"]
    offsets = tips - tips.mean(1, keepdims=True)
    area = jnp.cross(offsets, jnp.roll(offsets, -1, 1)).sum(1)
    normal = area / jnp.linalg.norm(area, axis=1, keepdims=True)
    along = (normal * spin_axes(run)).sum(1, keepdims=True)
    return jnp.where(along < 0.0, -normal, normal)
