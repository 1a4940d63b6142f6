"""The table [deployment]: tethers, or a chain, that are paid out from reels, and its checks."""

from typing import Any, Literal

import numpy as np

from esail_jax.scenes import rules
from esail_jax.scenes.declarations import declare, per_member, table
from esail_jax.scenes.own_terms import AbsentTerms, kind_of
from esail_jax.scenes.rules import (
    History,
    Number,
    PerMember,
    SceneError,
    Series,
    Shape,
    any_number,
    choice,
    increasing,
    positive,
)

PayoutName = Literal["table", "exponential"]
WinchName = Literal["table", "exponential", "tension"]

LEAST_SHARE = 1.0 / 200.0
"""Least length that is deployed at the start, over that of the tether: frequencies along a tether grow as
its length falls, rates of damping as the square."""


@table
class Deployment:
    """Tethers are paid out from reels at their roots, or reeled in; `tethers.length` is the length in all.
    Law table: the rate is linear between instants, and constant before the first and after the last. Law
    exponential: the length is start_length exp(growth t). Law tension: a motor holds a tension, which is
    linear between instants, and the length is an unknown of every tether."""

    start_length: PerMember = per_member(positive, unit="m", doc="Length that is deployed at t = 0.")
    law: WinchName = declare(
        choice(WinchName),
        unit="-",
        doc="How the length follows from time, or from a tension.",
        default="table",
    )
    time: Series | None = declare(
        increasing,
        shape=Shape.SERIES,
        unit="s",
        doc="Laws table and tension: instants of the rows of `rate` or `tension`.",
        default=None,
    )
    rate: History | None = declare(
        any_number,
        shape=Shape.HISTORY,
        unit="m/s",
        doc="Law table: rate of payout, a row per instant, one number or one per tether; negative: in.",
        default=None,
    )
    growth: PerMember | None = per_member(
        any_number, unit="1/s", doc="Law exponential: growth of the length, over the length.", default=None
    )
    tension: History | None = declare(
        any_number,
        shape=Shape.HISTORY,
        unit="N",
        doc="Law tension: what the motor holds, a row per instant, one number or one per tether; positive: "
        "against payout.",
        default=None,
    )
    drum_mass: PerMember | None = per_member(
        positive,
        unit="kg",
        doc="Law tension: inertia of drum and motor over the radius squared.",
        default=None,
    )


@table
class ChainDeployment:
    """A chain is paid out from a reel at its first joint, or reeled in; the lengths of its rods are those
    of the chain in all. Every rod keeps its share of what is deployed. Law table: the rate is linear
    between instants, and constant before the first and after the last. Law exponential: the length is
    start_length exp(growth t), as in the classical theory of deployment in orbit."""

    start_length: Number = declare(positive, unit="m", doc="Length that is deployed at t = 0.")
    law: PayoutName = declare(
        choice(PayoutName), unit="-", doc="How the length follows from time.", default="table"
    )
    time: Series | None = declare(
        increasing,
        shape=Shape.SERIES,
        unit="s",
        doc="Law table: instants of `rate`.",
        default=None,
    )
    rate: Series | None = declare(
        any_number,
        shape=Shape.SERIES,
        unit="m/s",
        doc="Law table: rate of payout at every instant; negative: in.",
        default=None,
    )
    growth: Number | None = declare(
        any_number, unit="1/s", doc="Law exponential: growth of the length, over the length.", default=None
    )


LAWS: dict[WinchName, tuple[str, ...]] = {
    "table": ("rate", "time"),
    "exponential": ("growth",),
    "tension": ("tension", "time", "drum_mass"),
}
"""Keys of every law."""


def check_deployment(scene: Any) -> None:
    """Checks that the law has its keys, that the lengths stay within those of the tethers, and that the
    scene has no part that does not go with tethers that are paid out. Raises SceneError."""
    check_law(scene)
    check_parts(scene)
    check_lengths(scene, rules.known(scene.tethers.length), scene.tethers.count)


def check_chain_deployment(scene: Any) -> None:
    """The same for a chain. Raises SceneError."""
    chain = scene.chain
    check_law(scene)
    if chain.bending:
        raise SceneError("chain.bending", "be left out with [deployment]", "is given")
    if scene.integrator.method == "energy-momentum":
        must = "be one of the others with [deployment]"
        raise SceneError("integrator.method", must, 'is "energy-momentum"')
    no_own_fields(scene)
    each: dict[str, Any] = {
        name: rules.known(getattr(chain, name)) for name in ("mass", "length", "area", "youngs_modulus")
    }
    if any(x is None for x in each.values()):
        return
    each["mass"] = each["mass"] / each["length"]
    for name in ("mass", "area", "youngs_modulus"):
        if np.ptp(each[name]) > 1e-12 * np.max(each[name]):
            must = "be the same for all rods" + (", per length," if name == "mass" else "")
            raise SceneError(f"chain.{name}", f"{must} with [deployment]", "differs")
    total = np.broadcast_to(each["length"], (chain.rods,)).sum()
    check_lengths(scene, total, 1)
    vectors, start = (rules.known(x) for x in (scene.initial.rod_vector, scene.deployment.start_length))
    if vectors is None or start is None:
        return
    drawn = np.linalg.norm(np.broadcast_to(vectors, (chain.rods, 3)), axis=1).sum()
    if not 0.5 * start < drawn < 1.5 * start:
        must = f"be the rods of what is deployed, {float(start):g} m in all"
        raise SceneError("initial.rod_vector", must, f"is {drawn:g} m in all")


def check_law(scene: Any) -> None:
    """Checks the keys of the law. Raises SceneError."""
    deployment = scene.deployment
    law, own = deployment.law, LAWS[deployment.law]
    optional = ("time", "tension") if law == "tension" and has_winch_law(scene) else ()
    for name in dict.fromkeys(name for names in LAWS.values() for name in names):
        given = getattr(deployment, name, None) is not None
        if name in own and not given:
            if name in optional and all(getattr(deployment, x) is None for x in optional):
                continue
            replaced = law == "tension" and name in ("time", "tension")
            or_law = ", or a WinchLaw among the terms," if replaced else ""
            raise SceneError(f"deployment.{name}", f"be given{or_law} with the law {law}", "is missing")
        if name not in own and given:
            raise SceneError(f"deployment.{name}", f"be left out with the law {law}", "is given")
    if deployment.time is not None:
        if rules.known(deployment.time) is None:
            got = "is traced: its derivative is not known"
            raise SceneError("deployment.time", "be plain numbers", got)
        check_rows(deployment, own[0], scene.members)


def check_starts_at_rest(deployment: Deployment | ChainDeployment) -> None:
    """Raises SceneError unless the rates are zero at t = 0."""
    if deployment.law not in ("table", "exponential"):
        return
    key = "rate" if deployment.law == "table" else "growth"
    rate: Any = rules.known(getattr(deployment, key))
    if rate is not None and deployment.law == "table":
        time: Any = deployment.time
        rate = np.array([np.interp(0.0, time, row) for row in rate.reshape(len(rate), -1).T])
    if rate is not None and np.any(rate != 0.0):
        must = "be zero at t = 0 for modes, which are those at the length of the start"
        raise SceneError(f"deployment.{key}", must, rules.describe(rate))


def has_winch_law(scene: Any) -> bool:
    """Tells whether a law of a user says what motors hold, or may say so: a run file has no terms."""
    if isinstance(scene.terms, AbsentTerms):
        return True
    return any(kind_of(term) == "WinchLaw" for term in scene.terms)


def check_parts(scene: Any) -> None:
    """Refuses what is not computed while tethers are paid out. Raises SceneError."""
    without = "be left out with [deployment]"
    for name in ("auxiliary_tethers", "event"):
        if getattr(scene, name) is not None:
            raise SceneError(name, without, "is given")
    if scene.tethers.root == "clamped":
        raise SceneError("tethers.root", 'be "pinned" with [deployment]', 'is "clamped"')
    if scene.tethers.bending_damping_time is not None:
        raise SceneError("tethers.bending_damping_time", without, "is given")
    if scene.initial.elongation == "paper":
        raise SceneError("initial.elongation", 'be "steady" with [deployment]', 'is "paper"')
    if scene.integrator.method == "energy-momentum":
        must = "be one of the others with [deployment]"
        raise SceneError("integrator.method", must, 'is "energy-momentum"')
    no_own_fields(scene)


def no_own_fields(scene: Any) -> None:
    """Refuses acceleration fields of one's own, which would not feel all of the velocity. Raises
    SceneError."""
    if not isinstance(scene.terms, AbsentTerms):
        for i, term in enumerate(scene.terms):
            if kind_of(term) == "Field":
                got = f"{type(term).__name__} is one"
                raise SceneError(f"terms[{i}]", "be no Field with [deployment]", got)


def check_rows(deployment: Deployment | ChainDeployment, name: str, members: rules.Members) -> None:
    """Checks that there is a row of rates or tensions per instant. Raises SceneError."""
    time: Any = deployment.time
    rows: Any = getattr(deployment, name)
    if np.ndim(time) == 0:
        raise SceneError("deployment.time", "be a list of instants", rules.describe(time))
    count, shape = np.shape(time)[0], np.shape(rows)
    if not shape or shape[0] != count:
        must = f"have as many rows as `deployment.time` has instants ({count})"
        has = f"has {shape[0]} rows" if shape else rules.describe(rows)
        raise SceneError(f"deployment.{name}", must, has)
    if len(shape) == 2 and shape[1] != members.count:
        must = f"have rows of {members.count} (`{members.key}`)"
        raise SceneError(f"deployment.{name}", must, f"has rows of {shape[1]}")


def check_lengths(scene: Any, total: Any, count: int) -> None:
    """Checks that what is deployed is a part of every tether for all of the run. Numbers that are traced
    have no value to check. total: lengths in all [m], None for traced ones; count: of tethers, or 1 for a
    chain. Raises SceneError."""
    deployment = scene.deployment
    names = ("start_length", "time", "rate", "growth")
    given = {name: getattr(deployment, name) for name in names if getattr(deployment, name) is not None}
    known: dict[str, Any] = {name: rules.known(x) for name, x in given.items()}
    known["L"] = total
    if any(x is None for x in known.values()):
        return
    total, start = (np.broadcast_to(known[name], (count,)) for name in ("L", "start_length"))
    for i in range(count):
        if start[i] > total[i] or start[i] < LEAST_SHARE * total[i]:
            whole = "`tethers.length`" if scene.chain is None else "the length of all rods"
            must = f"be between a two-hundredth of {whole} and all of it, {total[i]:g}"
            which = f" for tether {i + 1}" if scene.chain is None else ""
            raise SceneError("deployment.start_length", must, f"is {start[i]:g}{which}")
    if deployment.law == "tension":
        return
    key = "deployment.rate" if deployment.law == "table" else "deployment.growth"
    instants, lengths = lengths_of(known, start, scene.integrator.t_end)
    good = (lengths > 0.0) & (lengths <= total * (1.0 + 1e-9))
    if not good.all():
        row, tether = np.argwhere(~good)[0]
        which = f"tether {tether + 1}" if scene.chain is None else "the chain"
        must = f"leave {which} a length between 0 and {total[tether]:g} m in all of the run"
        raise SceneError(key, must, f"it is {lengths[row, tether]:g} m at {instants[row]:g} s")


def lengths_of(known: dict[str, Any], start: np.ndarray, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Instants [s], and the lengths [m] there, (instant, tether): those at which a length is greatest or
    least are among them."""
    if "growth" in known:
        instants = np.array([0.0, end])
        return instants, start * np.exp(np.broadcast_to(known["growth"], start.shape) * instants[:, None])
    times, rates = known["time"], known["rate"]
    rates = np.broadcast_to(rates if rates.ndim == 2 else rates[:, None], (len(times), len(start)))
    turns = []
    for k in range(len(times) - 1):
        for before, after in zip(rates[k], rates[k + 1], strict=True):
            if before * after < 0.0:
                turns.append(times[k] + (times[k + 1] - times[k]) * before / (before - after))
    instants = np.unique([0.0, end, *(t for t in (*times, *turns) if 0.0 < t < end)])
    at = np.stack([np.interp(instants, times, rate) for rate in rates.T], axis=1)
    # The rate is linear between these instants: the trapezoidal rule is exact.
    steps = 0.5 * (at[1:] + at[:-1]) * np.diff(instants)[:, None]
    return instants, start + np.concatenate([np.zeros((1, len(start))), np.cumsum(steps, axis=0)])
