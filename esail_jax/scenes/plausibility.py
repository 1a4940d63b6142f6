"""Numbers of a scene that may be in another unit than SI, or that have no effect: each is a sentence, and
nothing is refused.

They are found before anything is compiled, from the numbers that have a value; what is traced has none.
Units are judged only of a sail in the solar wind.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from esail_jax.constants import SLOW_SPIN
from esail_jax.scenes import rules
from esail_jax.scenes.hub import inertia_of, root_positions
from esail_jax.scenes.scene import Scene

Values = np.ndarray | float
"""Numbers of a key: one, or one per tether."""


class Usual(NamedTuple):
    """The range beyond which a number is doubted, far from every sail that was proposed, and what is usual,
    with its unit."""

    least: float
    most: float
    usual: str


USUAL = {
    "solar_wind.speed": Usual(1e4, 3e6, "4e5 m/s"),
    "solar_wind.number_density": Usual(1e3, 1e9, "7e6 1/m^3"),
    "tethers.length": Usual(50.0, 1e6, "1e4 m"),
    "tethers.wire_radius": Usual(1e-7, 1e-3, "1e-5 m"),
}
"""By scene key. The density of 1e3 1/m^3 is that of the wind at 80 au. The largest speed and density are
beyond every solar storm."""

FILLS = {"solar_wind.speed": 9.999e6, "solar_wind.number_density": 9.999e8}
"""Values that data of OMNI have where nothing was measured: 9999 km/s, 999.9 per cm^3."""

FARTHEST = 100.0
"""Distance from the Sun [au] beyond which the unit of a position is doubted."""

FAR_ROOTS = 10.0
"""Distance of a root or of the centre of mass from the hub centre, over the radius of gyration of the hub,
from which on the units are doubted."""

OF_THE_SENSE = ("harmonic", "phase-window", "feedback")
"""Voltage laws that depend on the sense of the spin: in it grows the phase, and feedback turns the axis."""

STRAINED = 0.01
"""Strain of a tether by the spin alone above which the numbers are doubted: metals yield at less."""


def doubts(scene: Scene) -> tuple[str, ...]:
    """Sentences about numbers that may be in a wrong unit, and about a hub that spins about an axis that is
    not stable."""
    # An axis follows from other numbers, which may be doubted already.
    return doubts_of_units(scene) or tuple(filter(None, [doubt_of_roots(scene), doubt_of_axis(scene)]))


def doubts_of_units(scene: Scene) -> tuple[str, ...]:
    """Sentences about numbers that may be in a wrong unit."""
    if scene.chain is not None or scene.solar_wind is None:
        return ()
    sentences = [doubt_of(scene, key) for key in USUAL]
    sentences += [f(scene) for f in (doubt_of_thrust, doubt_of_distance, doubt_of_step, doubt_of_sense)]
    # A strain follows from other numbers, which may be doubted already.
    return tuple(filter(None, sentences)) or tuple(filter(None, [doubt_of_strain(scene)]))


BENDING = "second_moment", "bending_damping_time", "straight_turn"
"""Keys of tethers and chains that take effect with bending stiffness only."""


def without_effect(scene: Scene) -> tuple[str, ...]:
    """A sentence if numbers of bending are given for tethers or a chain without bending stiffness. A user
    of truss elements, which cannot bend, knows that."""
    table, body = ("chain", scene.chain) if scene.chain is not None else ("tethers", scene.tethers)
    if body.bending or getattr(body, "element", "cable") == "truss":
        return ()
    given = [f"`{table}.{name}`" for name in BENDING if getattr(body, name, None) is not None]
    have = "has" if len(given) == 1 else "have"
    cause = f"because `{table}.bending` is false"
    return (f"{' and '.join(given)} {have} no effect, {cause}",) if given else ()


def doubt_of(scene: Scene, key: str) -> str:
    """A sentence if a number is far from what is usual, otherwise an empty text. Zero is meant as such."""
    values, unit = numbers(scene, key), USUAL[key].usual.split()[1]
    if values is None or not values.any():
        return ""
    if key in FILLS and np.isclose(values, FILLS[key], rtol=1e-9, atol=0.0).any():
        return f"`{key}` has {FILLS[key]:g} {unit}, which data of OMNI have where nothing was measured."
    values = values[values != 0.0]
    off = values.min() if values.min() < USUAL[key].least else values.max()
    if USUAL[key].least <= off <= USUAL[key].most:
        return ""
    return f"`{key}` is {off:g} {unit}, where {USUAL[key].usual} is usual: is it in this unit?"


def doubt_of_thrust(scene: Scene) -> str:
    """A sentence if no tether can have thrust: the constant voltage, or the maximum of any law, does not
    exceed the cutoff voltage. A voltage of zero is meant as such."""
    cutoff = numbers(scene, "solar_wind.cutoff_voltage")
    keys = ("voltage.maximum", "voltage.value") if scene.voltage.law == "constant" else ("voltage.maximum",)
    for key in keys:
        volts = numbers(scene, key)
        if cutoff is not None and volts is not None and volts.any() and volts.max() <= cutoff:
            below = f"which is not above `solar_wind.cutoff_voltage`, {cutoff:g} V"
            return f"`{key}` is {volts.max():g} V, {below}: no tether has thrust. Is it in this unit?"
    return ""


def doubt_of_distance(scene: Scene) -> str:
    """A sentence if the sail is farther from the Sun than FARTHEST."""
    keys = ("initial.heliocentric_position_au", "orbit.position_au")
    for key in keys:
        position = numbers(scene, key) if getattr(scene, key.partition(".")[0]) is not None else None
        far = 0.0 if position is None else float(np.linalg.norm(position))
        if far > FARTHEST:
            return f"`{key}` is {far:g} au from the Sun: is it in this unit?"
    return ""


def doubt_of_sense(scene: Scene) -> str:
    """A sentence if the voltage law relies on the sense of the spin and there is hardly any."""
    spin, law = numbers(scene, "initial.spin_rate"), scene.voltage.law
    if law not in OF_THE_SENSE or spin is None or abs(spin) >= SLOW_SPIN:
        return ""
    fades = f"below {SLOW_SPIN:g} rad/s the sense of the spin fades"
    return f"`initial.spin_rate` is {spin:g} rad/s: {fades}, on which the law {law} relies."


def doubt_of_strain(scene: Scene) -> str:
    """A sentence if the spin strains a tether by more than STRAINED: the centrifugal force of the tether
    and the remote unit over EA, omega^2 (m L + rho A L^2/2)/(E A)."""
    keys = (
        "initial.spin_rate",
        "tethers.length",
        "tethers.area",
        "tethers.density",
        "tethers.youngs_modulus",
    )
    mass = 0.0 if scene.remote_units is None else numbers(scene, "remote_units.mass")
    values = all_of([*(numbers(scene, key) for key in keys), mass])
    if values is None:
        return ""
    spin, length, area, density, modulus, tip = values
    strain = np.max(spin**2 * length * (tip + 0.5 * density * area * length) / (modulus * area))
    if strain <= STRAINED:
        return ""
    strained = f"which strains a tether by {strain:.2g}"
    return f"`initial.spin_rate` is {spin:g} rad/s, {strained}: is it in this unit?"


def doubt_of_roots(scene: Scene) -> str:
    """A sentence if the roots or the centre of mass of a spacecraft are far beyond its mass, by FAR_ROOTS
    times its radius of gyration sqrt(tr J/(2 m)), or if several tethers have one root."""
    hub = scene.hub
    if scene.chain is not None or hub is None or hub.mass is None:
        return ""
    numbers = {name: rules.known(getattr(hub, name)) for name in ("mass", "inertia", "centre", "roots")}
    given = {name: x for name, x in numbers.items() if x is not None and x.dtype != object}
    if not given.keys() >= {"mass", "inertia"}:
        return ""
    size = np.sqrt(0.5 * np.trace(given["inertia"]) / given["mass"])
    for name in ("centre", "roots"):
        far = np.max(np.linalg.norm(np.atleast_2d(given.get(name, np.zeros(3))), axis=1))
        if far > FAR_ROOTS * size:
            about = f"{far:.4g} m from the hub centre, and the radius of gyration is {size:.3g} m"
            return f"`hub.{name}` is {about}: are both in SI units?"
    if "roots" in given and scene.tethers.count > 1:
        places = np.broadcast_to(given["roots"], (scene.tethers.count, 3))
        if len(np.unique(places, axis=0)) < scene.tethers.count:
            return "`hub.roots` gives several tethers the same root: they would lie in each other."
    return ""


def doubt_of_axis(scene: Scene) -> str:
    """A sentence if a small tilt of the hub grows. In the turning frame, tethers of the tensions T_i whose
    roots are rho_i from the axis, and the hub's moments of inertia J, give the tilt the stiffness

        K = sum_i T_i rho_i/2 + (J_x - J_max) omega^2,     T_i = (m_u + rho A L/2) omega^2 L,

    with the largest moment J_max across the axis. It is negative for a long hub that hardly holds to its
    tethers."""
    if scene.chain is not None or scene.hub is None:
        return ""
    keys = ("length", "area", "density")
    parts = [rules.known(getattr(scene.tethers, key)) for key in keys]
    hub = [rules.known(x) for x in vars(scene.hub).values() if x is not None]
    mass = 0.0 if scene.remote_units is None else rules.known(scene.remote_units.mass)
    values = all_of([*parts, mass])
    if values is None or all_of(hub) is None:
        return ""
    length, area, density, tip = values
    arms = np.linalg.norm(root_positions(scene.hub, scene.tethers.count)[1:], axis=0)
    pull = (tip + 0.5 * density * area * length) * length
    inertia = inertia_of(scene.hub)
    across = np.linalg.eigvalsh(inertia[1:, 1:])[1]
    if 0.5 * np.sum(pull * arms) + inertia[0, 0] - across >= 0.0 or not np.any(scene.initial.spin_rate):
        return ""
    moments = f"{inertia[0, 0]:.3g} kg m^2, is less than that across, {across:.3g}"
    return (
        f"The hub spins about an axis that is not stable: its moment of inertia about X_B, {moments}, and "
        "the tethers do not hold it (`esail modes` tells how fast a tilt grows)."
    )


def doubt_of_step(scene: Scene) -> str:
    """A sentence if steps of a given size pass over what a table or a switch does within them."""
    step = None if scene.integrator.step is None else rules.known(scene.integrator.step)
    if step is None:
        return ""
    spans = {key: numbers(scene, key) for key in ("solar_wind.time", "voltage.time", "voltage.rise_time")}
    if scene.tip_thrust is not None:
        spans["tip_thrust.rise_time"] = numbers(scene, "tip_thrust.rise_time")
    for key, x in spans.items():
        series = key.endswith(".time")
        shortest = np.inf if x is None else np.min(np.diff(x) if series else x, initial=np.inf)
        if shortest < step:
            other = f"`{key}` {'has an interval of' if series else 'is'} {shortest:g} s"
            advice = "try a shorter step, or the method collocation"
            return f"`integrator.step` is {step:g} s, and {other}, which steps pass over ({advice})."
    return ""


def all_of(values: Iterable[Values | None]) -> list[Values] | None:
    """The values; None if one of them is."""
    found: list[Values] = []
    for value in values:
        if value is None:
            return None
        found.append(value)
    return found


def numbers(scene: Scene, key: str) -> np.ndarray | None:
    """The numbers of a key; None if the scene lacks it, or if they are traced."""
    table, _, name = key.partition(".")
    value = getattr(getattr(scene, table), name, None)
    return None if value is None else rules.known(value)
