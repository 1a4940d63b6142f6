"""Numbers of a scene that may be in another unit than SI, or that have no effect: each is a sentence, and
nothing is refused.

They are found before anything is compiled, from the numbers that have a value; what is traced has none.
Units are judged only of a sail in the solar wind.
"""

from typing import NamedTuple

import numpy as np

from esail_jax.scenes import rules
from esail_jax.scenes.scene import Scene


class Usual(NamedTuple):
    """The range beyond which a number is doubted, far from every sail that was proposed, and what is usual,
    with its unit."""

    least: float
    most: float
    usual: str


USUAL = {
    "solar_wind.speed": Usual(1e4, 1e7, "4e5 m/s"),
    "solar_wind.number_density": Usual(1e3, 1e10, "7e6 1/m^3"),
    "tethers.length": Usual(50.0, 1e6, "1e4 m"),
    "tethers.wire_radius": Usual(1e-7, 1e-3, "1e-5 m"),
}
"""By scene key. The density of 1e3 1/m^3 is that of the wind at 80 au."""


def doubts(scene: Scene) -> tuple[str, ...]:
    """Sentences about numbers that may be in a wrong unit."""
    if scene.chain is not None or scene.solar_wind is None:
        return ()
    found = [doubt_of(scene, key) for key in USUAL]
    return tuple(filter(None, (*found, doubt_of_thrust(scene))))


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


def numbers(scene: Scene, key: str) -> np.ndarray | None:
    """The numbers of a key; None if the scene lacks it, or if they are traced."""
    table, _, name = key.partition(".")
    value = getattr(getattr(scene, table), name)
    return None if value is None else rules.known(value)
