"""Builds what the parts of a scene bring (`parts.py`, `Part.terms`), one function per part, with the wind
and the voltage law, and the initial attitude.

The functions use jax.numpy only, so that results have derivatives with respect to every number of the
scene."""

import jax.numpy as jnp

from esail_jax.array_types import Array, Float, Maybe, PerTether, Rotation
from esail_jax.constants import ASTRONOMICAL_UNIT
from esail_jax.environment.circular_orbit import CircularOrbit
from esail_jax.environment.kepler_orbit import KeplerOrbit
from esail_jax.environment.orbit import orbital_frame
from esail_jax.environment.solar_wind import SteadyWind, Wind, WindOnOrbit, WindSeries
from esail_jax.environment.thrust_laws import DebyeSheath
from esail_jax.joints import roots as joints
from esail_jax.loads import voltage
from esail_jax.loads.constant_thrust import ConstantThrust
from esail_jax.loads.coulomb import CoulombThrust
from esail_jax.loads.electron_current import Collector, power_limited
from esail_jax.loads.fields import OrbitalField, SolarTide, UniformGravity
from esail_jax.loads.hub_torque import HubTorque
from esail_jax.loads.law_structure import NUMBER
from esail_jax.loads.own_law import ContinuousLaw, SampledLaw
from esail_jax.loads.phase_window import PhaseWindow
from esail_jax.loads.plasma_brake import PlasmaBrake, ions
from esail_jax.loads.tip_thrust import Switching, TipThrust
from esail_jax.loads.voltage_limits import Limits, within_slew_rate
from esail_jax.scenes.structure import Numbers, Structure
from esail_jax.scenes.voltage import OWN_LAW, PERIOD
from esail_jax.terms import Terms


def hub_torque(structure: Structure, numbers: Numbers) -> Terms:
    """The torque of [hub]."""
    if not structure.has("hub.torque"):
        return Terms()
    return Terms(hub_loads=(HubTorque(numbers["hub.torque"]),))


def solar_wind(structure: Structure, numbers: Numbers) -> Terms:
    """The thrust of [solar_wind] and [voltage] on a sail."""
    wind = wind_of(numbers, origin_of(numbers))
    law, collector = voltage_law(structure, numbers, wind), None
    if structure.has("tethers.wire_radius"):
        width = 2.0 * numbers["tethers.wire_radius"] * (structure["tethers.wires"] or 1)
        collector = Collector(width * numbers["tethers.length"], wind)
    if collector is not None and structure.has("voltage.power_limit"):
        law = power_limited(law, collector, numbers["voltage.power_limit"])
    elements, relative = structure["tethers.elements"], structure["solar_wind.relative"]
    return Terms(loads=(CoulombThrust.of(wind, law, elements, relative, collector),))


def solar_wind_at_chain(structure: Structure, numbers: Numbers) -> Terms:
    """The thrust of [solar_wind] and [voltage] on a chain, which has a voltage for every rod."""
    law, relative = voltage.Constant(numbers["voltage.value"]), structure["solar_wind.relative"]
    return Terms(loads=(CoulombThrust.of(wind_of(numbers, origin_of(numbers)), law, 1, relative),))


def tip_thrust(structure: Structure, numbers: Numbers) -> Terms:
    """The forces of [tip_thrust] on the remote units."""
    switching = None
    if structure.has("tip_thrust.on"):
        switching = Switching(*(numbers[f"tip_thrust.{key}"] for key in ("on", "off", "rise_time")))
    direction = structure["tip_thrust.direction"]
    return Terms(tip_loads=(TipThrust(numbers["tip_thrust.force"], switching, direction),))


def plasma_brake(structure: Structure, numbers: Numbers) -> Terms:
    """The load of [plasma_brake] on a chain."""
    names = ("speed", "number_density", "ion_mass_u", "tether_radius", "voltage")
    speed, density, mass, radius, voltage = (numbers[f"plasma_brake.{name}"] for name in names)
    return Terms(loads=(PlasmaBrake(speed, density, ions(mass), radius, voltage),))


def gravity(structure: Structure, numbers: Numbers) -> Terms:
    """The field of [gravity]."""
    return Terms(fields=(UniformGravity(numbers["gravity.acceleration"]),))


def circular_orbit(structure: Structure, numbers: Numbers) -> Terms:
    """The field in the axes of the [orbit] of a chain."""
    return Terms(fields=(OrbitalField(CircularOrbit(numbers["orbit.mean_motion"])),))


def heliocentric_orbit(structure: Structure, numbers: Numbers) -> Terms:
    """The tide of the Sun on a sail with an [orbit]."""
    return Terms(fields=(SolarTide(KeplerOrbit(*state_on_orbit(numbers))),))


def wind_of(numbers: Numbers, origin: Float[Array, "3"]) -> Wind:
    """The wind of [solar_wind]. origin: R_0 [m], heliocentric position of the inertial frame's origin."""
    orbit = kepler_orbit_of(numbers)
    if orbit is None:
        return wind_at(numbers, origin)
    distance = numbers.get("solar_wind.reference_distance_au", jnp.ones(())) * ASTRONOMICAL_UNIT
    return WindOnOrbit(wind_at(numbers, origin), orbit, distance)


def kepler_orbit_of(numbers: Numbers) -> KeplerOrbit | None:
    """The orbit of a sail about the Sun; None without one."""
    if "orbit.position_au" not in numbers:
        return None
    return KeplerOrbit(*state_on_orbit(numbers))


def state_on_orbit(numbers: Numbers) -> tuple[Float[Array, "3"], Float[Array, "3"]]:
    """Heliocentric position [m] and velocity [m/s] of a sail on its orbit at t = 0."""
    return numbers["orbit.position_au"] * ASTRONOMICAL_UNIT, numbers["orbit.velocity"]


def wind_at(numbers: Numbers, origin: Float[Array, "3"]) -> SteadyWind | WindSeries:
    """The wind of [solar_wind] at one place, steady or a series."""
    speed, density = numbers["solar_wind.speed"], numbers["solar_wind.number_density"]
    cutoff, sheath = numbers.get("solar_wind.cutoff_voltage"), None
    if "solar_wind.electron_temperature_ev" in numbers:
        temperature = numbers["solar_wind.electron_temperature_ev"]
        sheath = DebyeSheath(temperature, numbers["solar_wind.tether_radius"])
    about = cutoff, origin, sheath, numbers.get("solar_wind.thrust_factor")
    if "solar_wind.time" not in numbers:
        return SteadyWind(speed, density, *about)
    time = numbers["solar_wind.time"]
    speed, density = (jnp.broadcast_to(x, time.shape) for x in (speed, density))
    return WindSeries(time, speed, density, *about)


def voltage_law(structure: Structure, numbers: Numbers, wind: Wind) -> voltage.VoltageLaw:
    """The voltage law of [voltage]."""
    law, limits = structure["voltage.law"], limits_of(numbers)
    value: Maybe[Array] = numbers.get("voltage.value")
    slew = numbers.get("voltage.slew_rate")
    if law == "harmonic":
        given = [numbers[key] for key in ("voltage.cosine", "voltage.sine") if key in numbers]
        cosine, sine = (
            per_tether(numbers.get(f"voltage.{x}", 0.0 * given[0]), value) for x in ("cosine", "sine")
        )
        return voltage.Harmonic(value, cosine, sine, limits, slew)
    if law == "piecewise-linear":
        time, table = numbers["voltage.time"], value * per_tether(numbers["voltage.table"], value)
        if slew is not None:
            table = within_slew_rate(time, table, slew)
        return voltage.TimeTable(time, table, limits)
    if law == "on-off":
        on, off, rise = numbers["voltage.on"], numbers.get("voltage.off"), numbers["voltage.rise_time"]
        return voltage.OnOff(value, on, off, rise, limits, slew)
    if law == "phase-window":
        on, off, rise = (jnp.deg2rad(numbers[f"voltage.{x}_phase_deg"]) for x in ("on", "off", "rise"))
        return PhaseWindow(value, on, off, rise, limits)
    if law == "feedback":
        pitch = numbers | {"initial.sailing_angle_deg": numbers["voltage.target_sailing_angle_deg"]}
        gain = numbers["voltage.gain"]
        axis: voltage.AxisName = structure["voltage.measured_axis"] or "hub"
        if structure.has("orbit"):
            target = orbital_attitude(pitch)[:, 0]
            return voltage.OrbitalFeedback(value, gain, target, limits, slew, axis)
        target = starting_attitude(pitch)[0][:, 0]
        return voltage.Feedback(value, gain, target, limits, slew, axis)
    if law == "constant-thrust":
        return ConstantThrust(numbers["voltage.thrust"], numbers["tethers.length"], wind, limits)
    if law == "python":
        return users_law(structure, numbers)
    if law == "planar-cone":
        return planar_cone(numbers, wind, limits, slew)
    return voltage.Constant(value if limits.maximum is None else limits(value))


def limits_of(numbers: Numbers) -> Limits:
    """The limits of the voltages."""
    return Limits(numbers.get("voltage.maximum"), numbers.get("voltage.limit_blend"))


def users_law(structure: Structure, numbers: Numbers) -> voltage.VoltageLaw:
    """The voltage law that a user wrote, within the limits of [voltage]."""
    law, period = structure[OWN_LAW], structure[PERIOD]
    law_numbers = tuple(numbers[f"{OWN_LAW}.{i}"] for i in range(law.others.count(NUMBER)))
    limits, slew = limits_of(numbers), numbers.get("voltage.slew_rate")
    if period is None:
        return ContinuousLaw(law, law_numbers, limits)
    change = None if slew is None else slew * period
    return SampledLaw(law, law_numbers, limits, change, jnp.zeros(structure["tethers.count"]))


def planar_cone(numbers: Numbers, wind: Wind, limits: Limits, slew: Array | None) -> voltage.PlanarCone:
    """The planar-cone law for rigid tethers of the scene's lengths and masses at its sailing angle."""
    coning, sailing = (
        jnp.deg2rad(numbers[key]) for key in ("voltage.coning_angle_deg", "initial.sailing_angle_deg")
    )
    length, tip = numbers["tethers.length"], numbers.get("remote_units.mass", 0.0)
    inertia = tip * length**2 + numbers["tethers.density"] * numbers["tethers.area"] * length**3 / 3.0
    wind = wind.at_sail(jnp.zeros(()), origin_of(numbers))
    per_volt = wind.speed * wind.thrust_per_speed(wind.cutoff_voltage + 1.0)
    bar = voltage.cone_load(inertia, numbers["voltage.spin_rate"], coning, sailing, length)
    x = jnp.broadcast_to(jnp.tan(sailing) * jnp.tan(coning), length.shape)
    return voltage.PlanarCone(bar, x, wind.cutoff_voltage, per_volt, limits, slew)


def per_tether(rows: Array, like: PerTether) -> Float[Array, "row tether"]:
    """Rows with one number per tether, from rows of one number for all tethers or of one for each."""
    return jnp.broadcast_to(rows if rows.ndim == 2 else rows[:, None], (rows.shape[0], *like.shape))


def starting_attitude(numbers: Numbers) -> tuple[Rotation, Float[Array, "3"]]:
    """Initial attitude C_B^I(0), the orbital frame turned by (alpha - 90 deg) about Y_O, and R_0 [m]."""
    origin = origin_of(numbers)
    turned = orbital_attitude(numbers)
    return orbital_frame(origin) @ turned, origin


def origin_of(numbers: Numbers) -> Float[Array, "3"]:
    """Heliocentric position [m] of the origin of the inertial frame at t = 0; zero for a chain that has
    none."""
    key = "orbit.position_au" if "orbit.position_au" in numbers else "initial.heliocentric_position_au"
    return (numbers[key] if key in numbers else jnp.zeros(3)) * ASTRONOMICAL_UNIT


def orbital_attitude(numbers: Numbers) -> Rotation:
    """Initial attitude C_B^O(0) in the orbital frame: a turn by (alpha - 90 deg) about Y_O."""
    return joints.rotation_about_y(jnp.deg2rad(numbers["initial.sailing_angle_deg"] - 90.0))
