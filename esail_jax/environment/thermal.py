"""The temperature of a thin wire in sunlight and shadow, as a series for `[thermal]`.

A wire of diameter d is so thin that its temperature is uniform over the cross section. Conduction along it
is negligible. Sunlight falls on its projected width d, and it radiates from its whole surface:

    rho c (pi d^2/4) T' = a_s d S f(t) - e sigma pi d T^4

(lumped heat balance of a spacecraft part: Gilmore 2002, Spacecraft Thermal Control Handbook, Ch. 2). f is
the visible fraction of the Sun's disc. The sunlight is normal to the wire. Resistive heating by the
collected current, and the infrared radiation and the albedo of the eclipsing body, are left out.

    series = eclipse_series(ALUMINIUM, solar_flux(1.0), enter=100.0, leave=2000.0, penumbra=20.0)
    overrides = {f"thermal.{key}": x.tolist() for key, x in series.items()}
"""

import dataclasses
import itertools

import numpy as np
from scipy.integrate import solve_ivp

from esail_jax.array_types import Float
from esail_jax.constants import SOLAR_CONSTANT, STEFAN_BOLTZMANN

Times = Float[np.ndarray, "..."]


@dataclasses.dataclass(frozen=True)
class Wire:
    """A wire: diameter d [m], density rho [kg/m^3], specific heat c [J/(kg K)], absorptivity a_s for
    sunlight [-], emissivity e for thermal radiation [-]."""

    diameter: float
    density: float
    heat_capacity: float
    absorptivity: float
    emissivity: float

    def steady(self, flux: float) -> float:
        """Steady temperature [K] in sunlight of a flux [W/m^2]: T^4 = a_s S/(pi e sigma)."""
        return float((self.absorptivity * flux / (np.pi * self.emissivity * STEFAN_BOLTZMANN)) ** 0.25)

    def rate(self, temperature: Times, flux: Times | float) -> Times:
        """dT/dt [K/s] in sunlight of a flux [W/m^2]."""
        capacity = self.density * self.heat_capacity * np.pi * self.diameter / 4.0
        radiated = np.pi * self.emissivity * STEFAN_BOLTZMANN * temperature**4
        return (self.absorptivity * flux - radiated) / capacity


ALUMINIUM = Wire(diameter=37e-6, density=2700.0, heat_capacity=900.0, absorptivity=0.12, emissivity=0.04)
"""Bare, bright aluminium; four such wires have the area of the baseline's tethers."""


def solar_flux(distance_au: float) -> float:
    """Flux of sunlight S [W/m^2] at a distance from the Sun: the solar constant over r^2."""
    return SOLAR_CONSTANT / distance_au**2


def visible_fraction(time: Times | float, enter: float, leave: float, penumbra: float) -> Times | float:
    """Visible fraction f [-] of the Sun's disc in an eclipse by a body much larger than the disc, whose
    straight limb crosses it at constant speed:

        f = 1 - (arccos x - x sqrt(1 - x^2)) / pi,

    with x from 1 to -1 within `penumbra` seconds from the instant `enter`, and back from `leave` on. A
    penumbra of zero is a sudden shadow.
    """

    def covered(begin):
        share = (time >= begin) * 1.0 if penumbra == 0.0 else np.clip((time - begin) / penumbra, 0.0, 1.0)
        x = 1.0 - 2.0 * share
        return (np.arccos(x) - x * np.sqrt(1.0 - x**2)) / np.pi

    return 1.0 - covered(enter) + covered(leave)


def eclipse_temperature(
    wire: Wire, flux: float, times: Times, enter: float, leave: float, penumbra: float
) -> Times:
    """Temperatures T [K] at increasing instants [s] of a wire normal to the sunlight, which is steady
    before it enters an eclipse (`visible_fraction`). The relative error of the integration is some 1e-9.

    Raises ValueError unless the shadow is entered before it is left."""
    if not (penumbra >= 0.0 and enter + penumbra <= leave):
        raise ValueError("`leave` must not be before `enter` plus `penumbra`, but is")
    now, start = np.array([wire.steady(flux)]), min(enter, float(times[0]))
    temperatures: list[np.ndarray] = []
    parts = [start, enter, enter + penumbra, leave, leave + penumbra, np.inf]
    for begin, end in itertools.pairwise(parts):
        end = min(end, float(times[-1]))
        inside = times[(times > begin) & (times <= end)] if temperatures else times[times <= end]
        if end <= begin:
            temperatures.append(np.full(len(inside), now[0]))
            continue
        # The light jumps, or changes its rate, between the parts only.
        light = (begin + 1e-9 * (end - begin), end - 1e-9 * (end - begin))

        def slope(t, x, light=light):
            sun = visible_fraction(np.clip(t, *light), enter, leave, penumbra)
            return wire.rate(x, flux * sun)

        saved = np.union1d(inside, [end])
        run = solve_ivp(slope, (begin, end), now, "LSODA", saved, rtol=1e-9, atol=1e-9)
        temperatures.append(run.y[0][np.isin(saved, inside)])
        now = run.y[:, -1]
    return np.concatenate(temperatures)


def eclipse_series(
    wire: Wire,
    flux: float,
    enter: float,
    leave: float,
    penumbra: float,
    end: float | None = None,
    tolerance: float = 0.5,
) -> dict[str, Times]:
    """Time [s] and temperature [K] of an eclipse, for the keys `time` and `temperature` of `[thermal]`.

    end: last instant; without it an hour after the penumbra. The instants are as few as a straight line
    between each two of them, with an error of at most `tolerance` [K], allows by bisection at the largest
    error (Ramer, Douglas & Peucker): some fifty for an eclipse of half an hour.
    """
    last = leave + penumbra + 3600.0 if end is None else end
    changes = [enter, enter + penumbra, leave, leave + penumbra, last]
    spans = [np.linspace(a, b, 2001) for a, b in itertools.pairwise(changes) if b > a]
    time = np.unique(np.concatenate(spans))
    time = time[time <= last]
    temperature = eclipse_temperature(wire, flux, time, enter, leave, penumbra)
    kept, open_spans = {0, len(time) - 1}, [(0, len(time) - 1)]
    while open_spans:
        a, b = open_spans.pop()
        line = np.interp(time[a : b + 1], time[[a, b]], temperature[[a, b]])
        error = np.abs(temperature[a : b + 1] - line)
        worst = a + int(np.argmax(error))
        if error.max() > tolerance:
            kept.add(worst)
            open_spans += [(a, worst), (worst, b)]
    rows = np.array(sorted(kept))
    return {"time": time[rows], "temperature": temperature[rows]}


def thermal_toml(series: dict[str, Times], expansion: float, reference_temperature: float) -> str:
    """The table `[thermal]` of a scene file, as TOML text that reproduces every digit."""
    lines = [
        "[thermal]",
        f"expansion = {expansion!r}",
        f"reference_temperature = {reference_temperature!r}",
    ]
    lines += [f"{key} = {series[key].tolist()!r}" for key in ("temperature", "time")]
    return "\n".join(lines) + "\n"
