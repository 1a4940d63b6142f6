"""The table [voltage]: the modulation laws with their keys, and the voltage law that a user wrote. A scene
is read without JAX: nothing here imports it."""

import math
import sys
from typing import Any, Literal

import numpy as np

from esail_jax.scenes import rules
from esail_jax.scenes.declarations import declare, per_member, table
from esail_jax.scenes.rules import (
    Grid,
    Number,
    PerMember,
    SceneError,
    Series,
    Shape,
    any_number,
    between,
    choice,
    increasing,
    known,
    non_negative,
    positive,
)

LawName = Literal[
    "constant",
    "harmonic",
    "piecewise-linear",
    "on-off",
    "feedback",
    "planar-cone",
    "constant-thrust",
    "phase-window",
    "python",
]


LIMITS = ("maximum", "limit_blend")
"""Keys of the limits of the voltages, which every law takes."""


LAWS: dict[LawName, tuple[str, ...]] = {
    "constant": ("value", "maximum", "slew_rate"),
    "harmonic": ("value", "cosine", "sine", *LIMITS, "slew_rate"),
    "piecewise-linear": ("value", "time", "table", *LIMITS, "slew_rate"),
    "on-off": ("value", "on", "off", "rise_time", *LIMITS, "slew_rate"),
    "feedback": ("value", "gain", "target_sailing_angle_deg", "measured_axis", *LIMITS, "slew_rate"),
    "planar-cone": ("coning_angle_deg", "spin_rate", *LIMITS, "slew_rate"),
    "constant-thrust": ("thrust", *LIMITS),
    "phase-window": ("value", "on_phase_deg", "off_phase_deg", "rise_phase_deg", *LIMITS),
    "python": ("value", *LIMITS, "slew_rate"),
}
"""Modulation laws of the voltage, and the keys that each law takes."""


OPTIONAL_LAW_KEYS = ("cosine", "sine", "off", "measured_axis", *LIMITS, "slew_rate")
"""Keys that a law takes but does not require."""


MeasuredAxisName = Literal["hub", "angular-momentum"]


def amplitudes(function: str) -> Any:
    """Declares the amplitudes of a harmonic law. function: `cosine` or `sine`."""
    doc = f"Law harmonic: {function} amplitudes as fractions of V_0, one row per harmonic."
    return declare(any_number, shape=Shape.GRID, unit="-", doc=doc, default=None)


@table
class Voltage:
    """Voltage V_0 of the tethers, and the law by which it is modulated: in time, with the rotation of the
    sail, or by feedback. Each law has keys of its own."""

    value: PerMember | None = per_member(any_number, unit="V", doc="Voltage V_0 of a tether.", default=None)
    law: LawName = declare(choice(LawName), unit="-", doc="Modulation law.", default="constant")
    maximum: Number | None = declare(
        positive, unit="V", doc="Upper limit of the voltage; without it there is none.", default=None
    )
    limit_blend: Number | None = declare(
        between("(0, 0.5]"),
        unit="-",
        doc="Half width, as a fraction of `maximum`, of the ranges in which the voltage bends smoothly "
        "towards 0 and `maximum`, for derivatives; without it both limits are exact.",
        default=None,
    )
    slew_rate: Number | None = declare(
        positive,
        unit="V/s",
        doc="Upper limit of the voltage's rate; without it there is none.",
        default=None,
    )
    power_limit: Number | None = declare(
        positive,
        unit="W",
        doc="Upper limit of the electric power of all tethers; all voltages are reduced alike to keep it.",
        default=None,
    )
    cosine: Grid | None = amplitudes("cosine")
    sine: Grid | None = amplitudes("sine")
    time: Series | None = declare(
        increasing,
        shape=Shape.SERIES,
        unit="s",
        doc="Law piecewise-linear: instants of the rows of `table`.",
        default=None,
    )
    table: Grid | None = declare(
        non_negative,
        shape=Shape.GRID,
        unit="-",
        doc="Law piecewise-linear: voltages as fractions of V_0, one row per instant.",
        default=None,
    )
    on: PerMember | None = per_member(
        any_number, unit="s", doc="Law on-off: instant at which the voltage begins to rise.", default=None
    )
    off: PerMember | None = per_member(
        any_number,
        unit="s",
        doc="Law on-off: instant at which the voltage begins to fall; without it the voltage stays on.",
        default=None,
    )
    rise_time: Number | None = declare(
        positive, unit="s", doc="Law on-off: duration of the rise and of the fall.", default=None
    )
    on_phase_deg: PerMember | None = per_member(
        any_number,
        unit="deg",
        doc="Law phase-window: phase at which the voltage begins to rise.",
        default=None,
    )
    off_phase_deg: PerMember | None = per_member(
        any_number,
        unit="deg",
        doc="Law phase-window: phase at which the voltage begins to fall.",
        default=None,
    )
    rise_phase_deg: PerMember | None = per_member(
        between("(0, 360]"),
        unit="deg",
        doc="Law phase-window: angle of the rise and of the fall.",
        default=None,
    )
    gain: Number | None = declare(
        any_number, unit="-", doc="Law feedback: gain of the attitude error.", default=None
    )
    target_sailing_angle_deg: Number | None = declare(
        any_number,
        unit="deg",
        doc="Law feedback: sailing angle that defines the target of the spin axis.",
        default=None,
    )
    measured_axis: MeasuredAxisName | None = declare(
        choice(MeasuredAxisName),
        unit="-",
        doc='Law feedback: what is measured as the spin axis, "hub" if left out.',
        default=None,
    )
    coning_angle_deg: Number | None = declare(
        between("(-90, 90)"), unit="deg", doc="Law planar-cone: coning angle to be held.", default=None
    )
    spin_rate: Number | None = declare(
        any_number,
        unit="rad/s",
        doc="Law planar-cone: mean spin rate omega_0 of the tethers.",
        default=None,
    )
    thrust: Number | None = declare(
        positive, unit="N", doc="Law constant-thrust: size of the sail's thrust.", default=None
    )


@table
class ChainVoltage:
    """Voltage of a chain: constant."""

    value: PerMember = per_member(any_number, unit="V", doc="Voltage V_0 of a rod.")


def check_voltage(scene: Any) -> None:
    """Checks that the modulation law has the keys it needs and no others, and that their sizes agree.
    Raises SceneError."""
    check_has_wind(scene)
    table = scene.voltage
    used = LAWS[table.law]
    for name in used:
        if table.law == "python":
            continue  # `value` is the reference of a design and of the default tolerance
        if getattr(table, name) is None and name not in OPTIONAL_LAW_KEYS:
            with_law = "" if table.law == "constant" else f" with the law {table.law}"
            raise SceneError(f"voltage.{name}", "be given" + with_law, "is missing")
    for name in vars(table):
        if name not in (*used, "law", "power_limit") and getattr(table, name) is not None:
            raise SceneError(f"voltage.{name}", f"be left out with the law {table.law}", "is given")
    if table.power_limit is not None and scene.tethers.wire_radius is None:
        raise SceneError("tethers.wire_radius", "be given with `voltage.power_limit`", "is missing")
    if table.limit_blend is not None and table.maximum is None:
        raise SceneError("voltage.maximum", "be given with `voltage.limit_blend`", "is missing")
    if table.law == "phase-window":
        check_window(table)
    if table.law == "harmonic":
        rows = {name: np.shape(getattr(table, name)) for name in ("cosine", "sine")}
        if not rows["cosine"] and not rows["sine"]:
            raise SceneError("voltage.cosine", "be given with the law harmonic", "is missing")
        if rows["cosine"] and rows["sine"] and rows["cosine"][0] != rows["sine"][0]:
            must = f"have as many harmonics as `voltage.cosine` ({rows['cosine'][0]})"
            raise SceneError("voltage.sine", must, f"has {rows['sine'][0]}")
    if table.law == "piecewise-linear":
        rules.check_list("voltage.time", table.time)
        instants = np.shape(table.time)[0]
        if np.shape(table.table)[0] != instants:
            must = f"have as many rows as `voltage.time` has instants ({instants})"
            raise SceneError("voltage.table", must, f"has {np.shape(table.table)[0]}")
    if table.measured_axis == "angular-momentum":
        reason = "without [hub]" if scene.hub is None else "with [[event]]"
        if scene.hub is None or scene.event is not None:
            raise SceneError("voltage.measured_axis", f'be "hub" {reason}', f'is "{table.measured_axis}"')
    if table.law == "planar-cone" and scene.hub is not None:
        raise SceneError("voltage.law", "not be planar-cone with a hub", 'is "planar-cone"')
    if table.law == "planar-cone" and scene.solar_wind is not None:
        law = scene.solar_wind.thrust_law
        if law != "linear":
            raise SceneError("solar_wind.thrust_law", "be linear with the law planar-cone", f'is "{law}"')


def check_has_wind(scene: Any) -> None:
    """Refuses voltages without a wind. Raises SceneError."""
    if scene.solar_wind is None:
        raise SceneError("solar_wind.speed", "be given with [voltage]", "is missing")


def check_window(table: Any) -> None:
    """Checks that the window of the law phase-window is neither empty nor a whole turn. Raises
    SceneError."""
    on, off = rules.known(table.on_phase_deg), rules.known(table.off_phase_deg)
    if on is not None and off is not None and (np.mod(off - on, 360.0) == 0.0).any():
        must = "differ from `voltage.on_phase_deg` by more or less than whole turns"
        raise SceneError("voltage.off_phase_deg", must, rules.describe(table.off_phase_deg))


OWN_LAW = "voltage_law"
"""Key of the law among the overrides of a scene. It is no table, and no file can have it."""


PERIOD = f"{OWN_LAW}.period"
"""Name of the control period."""


KEPT = ("value", "maximum", "slew_rate", "power_limit")
"""Keys of [voltage] that stay when a user's law takes the place of the scene's own law."""


class MissingLaw(SceneError):
    """A scene that names a law in Python without the law itself."""


def check_law_of_user(scene: Any) -> None:
    """Checks that a voltage law in Python stands in a scene that can have it. Raises SceneError."""
    table = scene.voltage
    if scene.chain is not None:
        raise SceneError("voltage_law", "be left out with a chain", "is given")
    if table is None:
        raise SceneError("voltage_law", "be left out without [solar_wind]", "is given")
    if table.law != "python":
        raise SceneError("voltage.law", 'be "python" with `voltage_law`', f'is "{table.law}"')
    check_own_law(scene.voltage_law, table.slew_rate)


def check_own_law(law: Any, slew_rate: Any) -> None:
    """Raises SceneError unless a law has the methods and the period that a user's law must have."""
    equinox = sys.modules.get("equinox")
    if equinox is None or not isinstance(law, equinox.Module):
        raise SceneError(OWN_LAW, "be an equinox.Module", f"is a {type(law).__name__}")
    methods = [name for name in ("commanded", "init", "update") if callable(getattr(law, name, None))]
    if methods not in (["commanded"], ["init", "update"]):
        must = "have the method `commanded`, or the methods `init` and `update`"
        raise SceneError(
            OWN_LAW, must, f"{type(law).__name__} has {' and '.join(methods) or 'none of them'}"
        )
    if not hasattr(law, "period"):
        if "update" in methods:
            raise SceneError(PERIOD, "be given for a law with `update`", "is missing")
        if slew_rate is not None:
            raise SceneError(
                "voltage.slew_rate", f"be left out unless `{OWN_LAW}` has a `period`", "is given"
            )
        return
    period_of(law)


def check_has_law(name: str, law: Any) -> None:
    """Raises MissingLaw for a scene of a user's law without the law itself, such as that of a run file."""
    if name == "python" and law is None:
        raise MissingLaw(OWN_LAW, 'be given with `voltage.law` = "python"', "is missing")


def period_of(law: Any, name: str = PERIOD) -> float | None:
    """The control period [s] of a user's law; None for a law that is not sampled. name: of the period.
    Raises SceneError."""
    if law is None or not hasattr(law, "period"):
        return None
    period = law.period
    if known(period) is None:
        must = "be a plain number (declare the field with equinox.field(static=True))"
        raise SceneError(name, must, "is a traced value")
    try:
        number = math.nan if isinstance(period, str | bool) else float(period)
    except (TypeError, ValueError):
        number = math.nan
    if not 0.0 < number < math.inf:
        raise SceneError(name, "be positive", f"is {period!r}")
    return number
