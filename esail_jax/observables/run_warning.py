"""Warnings about a finished run: numbers of its scene, its energy balance, its step size, and tethers that
go slack, have no thrust or are under more stress than they bear."""

from collections.abc import Mapping, Sequence

import numpy as np

from esail_jax.observables.balance import balance_warning
from esail_jax.observables.lost_sail import lost_warning
from esail_jax.scenes.plausibility import doubts
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.tethers import Thermal

WARN_ABOVE = 7e-3
"""A warning is given if the estimated error of tips or forces exceeds this fraction of their range. The
value lies half-way between the largest estimate of runs with errors up to 1e-3 (5e-3) and the smallest
estimate of runs with errors of 1e-2 and more (`experiments/stability`)."""

SLACK = -1e-9
"""Largest elastic strain of a tether below which it is called slack: more than rounding."""

STEP_ERRORS = {"tip_error": "the tips", "root_force_error": "the forces at the roots"}
"""The error estimates of fixed-step methods (`steppers/step_error.py`), as fractions of a range: their
names and the words for the warning."""


def run_warning(
    rows: Mapping[str, np.ndarray], numerics: Mapping[str, np.ndarray], scene: Scene | None = None
) -> str:
    """The warnings about a finished run: those about its scene, one if no tether had thrust, one if its
    energy balance is violated, one if its steps are too long, one if tethers go slack or are overloaded, or
    an empty text.

    rows: observables by name; numerics: statistics of the steps per saved interval; scene: that of the run,
    None to judge the rows alone."""
    parts = [float(numerics[name][-1]) for name in STEP_ERRORS if name in numerics]
    if scene is None:
        return joined_warnings(rows, parts)
    lost = "" if scene.chain is not None else lost_warning(rows, scene)
    warnings = (
        *doubts(scene),
        idle_warning(rows, scene),
        lost,
        strength_warning(rows, scene),
        joined_warnings(rows, parts, scene.thermal),
    )
    return " ".join(filter(None, warnings))


def joined_warnings(
    rows: Mapping[str, np.ndarray], parts: Sequence[float], heat: Thermal | None = None
) -> str:
    """The warnings of `run_warning` from the error estimates `parts`, which are empty for methods
    with error control."""
    return " ".join(filter(None, (balance_warning(rows), step_warning(parts), slack_warning(rows, heat))))


def idle_warning(rows: Mapping[str, np.ndarray], scene: Scene) -> str:
    """A warning about a finished run in which a law that its user wrote gave no voltage with thrust
    at any saved instant, otherwise an empty text. Laws of the package may rest between saved instants, as
    their keys say."""
    wind = None if scene.chain is not None else scene.solar_wind
    if wind is None or wind.cutoff_voltage is None or "voltage" not in rows:
        return ""
    cutoff = np.asarray(wind.cutoff_voltage, float)
    most = np.max(rows["voltage"], initial=-np.inf, where=np.isfinite(rows["voltage"]))
    if scene.voltage.law != "python" or not most <= cutoff:
        return ""
    zero = " (a voltage below zero counts as zero)" if most == 0.0 else ""
    return (
        f"No tether has thrust at a saved instant: the largest voltage is {most:g} V{zero}, which "
        f"is not above `solar_wind.cutoff_voltage`, {cutoff:g} V."
    )


def strength_warning(rows: Mapping[str, np.ndarray], scene: Scene) -> str:
    """A warning if the largest stress of a tether, Young's modulus times its largest elastic strain,
    exceeds its strength at a saved instant, with the least margin, strength over stress less one. A run
    that did not save the strain, or the temperature of heated tethers, is not judged."""
    if scene.tethers is None or scene.tethers.strength is None or "max_axial_strain" not in rows:
        return ""
    heat, strain = scene.thermal, np.asarray(rows["max_axial_strain"])
    if heat is not None:
        if "temperature" not in rows:
            return ""
        strain = strain - np.asarray(heat.expansion) * (rows["temperature"] - heat.reference_temperature)
    use = np.asarray(scene.tethers.youngs_modulus) * strain / np.asarray(scene.tethers.strength)
    use = np.where(np.isfinite(use), use, 0.0)
    over = np.flatnonzero((use > 1.0).any(axis=0)) + 1
    if not over.size:
        return ""
    row, worst = np.unravel_index(int(use.argmax()), use.shape)
    which = f"Tether {over[0]} is" if over.size == 1 else f"Tethers {', '.join(map(str, over))} are"
    margin = 1.0 / use.max() - 1.0
    return (
        f"{which} under more stress than `tethers.strength`: the least margin is {margin:.0%}, of tether "
        f"{worst + 1} in saved row {row}."
    )


def slack_warning(rows: Mapping[str, np.ndarray], heat: Thermal | None = None) -> str:
    """A warning if the whole of a tether is under compression at a saved instant: its largest
    elastic strain, the strain less the thermal one, is negative. A run that did not save the observables
    of which this follows is not judged."""
    if "max_axial_strain" not in rows or (heat is not None and "temperature" not in rows):
        return ""
    strain = np.asarray(rows["max_axial_strain"])
    if heat is not None:
        above = np.asarray(rows["temperature"]) - np.asarray(heat.reference_temperature)
        strain = strain - np.asarray(heat.expansion) * above
    slack = np.flatnonzero((strain < SLACK).any(axis=0)) + 1
    if not slack.size:
        return ""
    which = f"Tether {slack[0]} goes" if slack.size == 1 else f"Tethers {', '.join(map(str, slack))} go"
    return (
        f"{which} slack: at some instant it is nowhere under tension, where a tether of this model pushes."
    )


def step_warning(parts: Sequence[float]) -> str:
    """A warning if an estimate exceeds WARN_ABOVE or is NaN, otherwise an empty text. parts:
    estimates in the order of STEP_ERRORS."""
    named = zip(STEP_ERRORS.values(), parts, strict=False)
    off = [f"{name} by {in_words(part)}" for name, part in named if not part <= WARN_ABOVE]
    return f"{SENTENCE} {' and '.join(off)}." if off else ""


SENTENCE = "The step is too long (try half of it): by the estimate of its errors it puts off"


def in_words(part: float) -> str:
    """A fraction of a range in words."""
    return f"about {part:.0e} of their range" if part < 1.0 else "as much as they range over"
