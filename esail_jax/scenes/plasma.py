"""The tables of the plasma about the tethers, solar wind and ionosphere: the laws of thrust and their
checks.

`solar_wind.file` in a scene's text stands for three keys of [solar_wind] (`wind_files/`). The scene then
holds the numbers themselves, so that a run file is complete without it."""

from typing import Any, Literal

import numpy as np

from esail_jax.constants import DEBYE_LENGTHS, ELEMENTARY_CHARGE, VACUUM_PERMITTIVITY
from esail_jax.scenes import declarations, rules
from esail_jax.scenes.declarations import declare, per_member, table
from esail_jax.scenes.rules import (
    Number,
    PerMember,
    SceneError,
    Series,
    Shape,
    any_number,
    choice,
    increasing,
    non_positive,
    positive,
)

ThrustLawName = Literal["linear", "debye-sheath"]


THRUST_LAWS: dict[ThrustLawName, tuple[str, ...]] = {
    "linear": ("cutoff_voltage",),
    "debye-sheath": ("electron_temperature_ev", "tether_radius"),
}
"""Laws of the thrust, and the keys that each law needs; all others are for other laws."""


@table
class SolarWind:
    """Solar wind at the sail ([PGV] after Eq. 28). With `time`, speed and density are given at those
    instants and change linearly between them. In a file, `file` may name files that give all three: CSV
    files whose first line is time,speed,number_density, or OMNI files of measured wind."""

    speed: Series = declarations.speed_of_wind(Shape.SERIES)
    number_density: Series = declarations.density_of_wind(Shape.SERIES)
    cutoff_voltage: Number | None = declare(
        any_number,
        unit="V",
        doc="Law linear: voltage V_1 below which a tether has no thrust.",
        default=None,
    )
    thrust_law: ThrustLawName = declare(
        choice(ThrustLawName),
        unit="-",
        doc="Law of the thrust: that of [PGV], or that of the electron sheath's size.",
        default="linear",
    )
    thrust_factor: Number | None = declarations.factor_of_thrust()
    electron_temperature_ev: Number | None = declare(
        positive, unit="eV", doc="Law debye-sheath: temperature of the wind's electrons.", default=None
    )
    tether_radius: Number | None = declare(
        positive,
        unit="m",
        doc="Law debye-sheath: radius of the wire, or effective radius of a tether of several wires.",
        default=None,
    )
    time: Series | None = declare(
        increasing,
        shape=Shape.SERIES,
        unit="s",
        doc="Instants at which lists of `speed` and `number_density` are given.",
        default=None,
    )
    relative: bool = declarations.wind_relative_to_point()
    reference_distance_au: Number | None = declare(
        positive,
        unit="au",
        doc="Distance of the Sun at which speed and density are given, 1 if left out; used with [orbit].",
        default=None,
    )


@table
class ChainWind:
    """Solar wind at a chain: steady."""

    speed: Number = declarations.speed_of_wind(Shape.SCALAR)
    number_density: Number = declarations.density_of_wind(Shape.SCALAR)
    cutoff_voltage: Number = declare(
        any_number, unit="V", doc="Voltage V_1 below which a rod has no thrust."
    )
    thrust_factor: Number | None = declarations.factor_of_thrust()
    relative: bool = declarations.wind_relative_to_point()


@table
class PlasmaBrake:
    """Coulomb drag of the ionosphere on a negative chain in low orbit. In the axes of the orbit the plasma
    streams along -y."""

    voltage: PerMember = per_member(
        non_positive, unit="V", doc="Voltage of a rod; one at zero has no drag."
    )
    speed: Number = declare(
        positive, unit="m/s", doc="Speed of the chain through the plasma, about that of the orbit."
    )
    number_density: Number = declare(positive, unit="1/m^3", doc="Number density of the plasma.")
    tether_radius: Number = declare(
        positive, unit="m", doc="Radius of the wire, or effective radius of a tether of several wires."
    )
    ion_mass_u: Number = declare(
        positive,
        unit="u",
        doc="Mass of an ion in atomic mass units; that of oxygen if left out.",
        default=16.0,
    )


def check_wind(scene: Any) -> None:
    """Checks that the law of thrust has its keys, and that a wind that varies in time has one value per
    instant, from the start of the run to its end. Raises SceneError."""
    table = scene.solar_wind
    check_has_voltage(scene)
    for law, keys in THRUST_LAWS.items():
        for name in keys:
            if law == table.thrust_law and getattr(table, name) is None:
                with_law = "" if law == "linear" else f" with the law {law}"
                raise SceneError(f"solar_wind.{name}", "be given" + with_law, "is missing")
            if law != table.thrust_law and getattr(table, name) is not None:
                must = f"be left out with the law {table.thrust_law}"
                raise SceneError(f"solar_wind.{name}", must, "is given")
    if table.thrust_law != "linear" and table.thrust_factor is not None:
        must = f"be left out with the law {table.thrust_law}"
        raise SceneError("solar_wind.thrust_factor", must, "is given")
    if table.reference_distance_au is not None and scene.orbit is None:
        raise SceneError("solar_wind.reference_distance_au", "be left out without [orbit]", "is given")
    least, most = table.electron_temperature_ev, table.number_density
    check_thin("solar_wind", table.tether_radius, least, most, DEBYE_LENGTHS)
    if table.time is not None:
        rules.check_list("solar_wind.time", table.time)
    count = None if table.time is None else np.shape(table.time)[0]
    for name in ("speed", "number_density"):
        shape = np.shape(getattr(table, name))
        if count is None and shape:
            raise SceneError(
                "solar_wind.time", f"be given with a list of `solar_wind.{name}`", "is missing"
            )
        if count is not None and shape not in ((), (count,)):
            must = f"be a number or a list of {count} (`solar_wind.time`)"
            raise SceneError(f"solar_wind.{name}", must, f"has {shape[0]} entries")
    time = None if count is None else rules.known(table.time)
    if time is not None and (time[0] > 0.0 or time[-1] < scene.integrator.t_end):
        must = f"reach from 0 to `integrator.t_end` ({scene.integrator.t_end:g})"
        raise SceneError("solar_wind.time", must, f"reaches from {time[0]:g} to {time[-1]:g}")


def check_chain_wind(scene: Any) -> None:
    """Checks the wind at a chain. Raises SceneError."""
    check_has_voltage(scene)
    if scene.initial.heliocentric_position_au is None:
        raise SceneError("initial.heliocentric_position_au", "be given with [solar_wind]", "is missing")
    if scene.solar_wind.relative and scene.orbit is not None:
        # The axes of the orbit turn: velocities in them are not those in inertial axes.
        raise SceneError("solar_wind.relative", "be false with [orbit]", "is true")


def check_has_voltage(scene: Any) -> None:
    """Refuses a wind without voltages. Raises SceneError."""
    if scene.voltage is None:
        raise SceneError("voltage.value", "be given with [solar_wind]", "is missing")


def check_brake(scene: Any) -> None:
    """Checks that a chain with a plasma brake is in an orbit, and thinner than its sheath. Raises
    SceneError."""
    table = scene.plasma_brake
    if scene.orbit is None:
        raise SceneError("orbit.mean_motion", "be given with [plasma_brake]", "is missing")
    volts = rules.known(table.voltage)
    least = None if volts is None else np.abs(np.where(volts < 0.0, volts, np.inf)).min()
    check_thin("plasma_brake", table.tether_radius, least, table.number_density)


def check_thin(table: str, radius: Any, volts: Any, density: Any, lengths: float = 1.0) -> None:
    """Checks that a tether is thinner than the sheath about it, `lengths` times sqrt(eps_0 V / (e n)):
    there the logarithms of the laws are positive. Traced numbers have no value to check. Raises
    SceneError."""
    known = [None if x is None else rules.known(x) for x in (radius, volts, density)]
    if any(x is None for x in known):
        return
    radius, volts, density = known
    sheath = lengths * np.sqrt(VACUUM_PERMITTIVITY * volts / (ELEMENTARY_CHARGE * np.max(density)))
    if radius >= sheath:
        must = f"be below the radius of the sheath ({sheath:.3g} m)"
        raise SceneError(f"{table}.tether_radius", must, rules.describe(radius))
