"""Laws of the thrust (`solar_wind.thrust_law`), the voltage law of a constant thrust, and winds whose
dynamic pressure has a gamma distribution."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.constants import PROTON_MASS
from esail_jax.environment.gusts import gamma_wind
from esail_jax.environment.solar_wind import SteadyWind
from esail_jax.environment.thrust_laws import DebyeSheath
from esail_jax.scenes.build_parts import origin_of, wind_of
from esail_jax.scenes.structure import split
from support.derivatives import check_both_modes
from support.quick import quickly

SHEATH = {"solar_wind.thrust_law": "debye-sheath", "solar_wind.electron_temperature_ev": 12.0,
          "solar_wind.tether_radius": 1e-5, "solar_wind.cutoff_voltage": None}  # fmt: skip
AVERAGE = (jnp.asarray(4e5), jnp.asarray(7.3e6), jnp.asarray(1e3), jnp.array([1e11, 0.0, 0.0]))
LAWS = {"linear": None, "debye-sheath": DebyeSheath(jnp.asarray(12.0), jnp.asarray(1e-5))}
PUSHED = {"voltage.law": "constant-thrust", "voltage.value": None, "voltage.thrust": 0.012}


def as_written(volts, speed=4e5, density=7.3e6, temperature=12.0, radius=1e-5):
    """The thrust per length [N/m] of Janhunen & Sandroos (2007), with the constants of scipy."""
    from scipy.constants import e, epsilon_0, m_p

    reach = 2.0 * np.sqrt(epsilon_0 * temperature / (e * density))
    x = m_p * speed**2 / (e * volts) * np.log(reach / radius)
    return 3.09 * m_p * density * speed**2 * reach / np.sqrt(np.exp(x) - 1.0)


def test_published_thrust_of_the_sheath(validate):
    """15 kV in the average wind at 1 au push with (50 +- 10) nN/m (Janhunen & Sandroos 2007, abstract). The
    formula with the constants of scipy: those of [PGV] differ by 2e-3 in m_p."""
    wind, volts = SteadyWind(*AVERAGE, LAWS["debye-sheath"]), np.array([0.0, -5.0, 1.0, 15e3, 40e3])
    load = 4e5 * np.asarray(wind.thrust_per_speed(jnp.asarray(volts)))
    assert load[0] == load[1] == 0.0 and load[2] < 1e-300
    assert np.allclose(load[3:], as_written(volts[3:]), rtol=4e-3, atol=0)
    validate(
        "THRUST-1", "thrust of the Debye sheath at 15 kV", "published simulations, 50 nN/m +- 20 %",
        "relative difference", abs(load[3] / 50e-9 - 1.0), 0.2,
    )  # fmt: skip


@pytest.mark.parametrize("wind", ["steady", "series", "orbit"])
def test_thrust_is_proportional_to_its_factor(wind):
    """`solar_wind.thrust_factor` in place of the 0.18 of the paper, in every kind of wind; the voltage of a
    thrust is that of the inverse law. The law of the sheath has no factor and refuses it."""
    more = {
        "steady": {},
        "series": {"solar_wind.time": [0.0, 1e4], "solar_wind.speed": [4e5, 5e5]},
        "orbit": {"orbit.position_au": [1.0, 0.0, 0.0], "orbit.velocity": [0.0, 3e4, 0.0],
                  "initial.heliocentric_position_au": None},
    }[wind]  # fmt: skip

    def at(factor):
        scene = esail.load_scene("baseline", more | {"solar_wind.thrust_factor": factor})
        _, numbers = split(scene)
        return wind_of(numbers, origin_of(numbers)).at_sail(jnp.asarray(10.0), origin_of(numbers))

    plain, other, paper = at(None), at(0.27), at(0.18)
    volts = jnp.asarray(2e4)
    assert float(paper.thrust_per_speed(volts)) == float(plain.thrust_per_speed(volts))
    assert float(other.thrust_per_speed(volts) / plain.thrust_per_speed(volts)) == pytest.approx(1.5, 1e-14)
    assert float(other.voltage(other.thrust_per_speed(volts))) == pytest.approx(2e4, 1e-14)
    with pytest.raises(esail.SceneError, match="must be left out with the law debye-sheath, but is given"):
        esail.load_scene("baseline", SHEATH | {"solar_wind.thrust_factor": 0.2})


@pytest.mark.parametrize("name", LAWS)
def test_voltage_is_the_inverse(name):
    """Every law of thrust is inverted, to rounding, and has a derivative also where it has no thrust."""
    wind = SteadyWind(*AVERAGE, LAWS[name])
    volts = jnp.array([2e3, 15e3, 40e3])
    assert np.allclose(wind.voltage(wind.thrust_per_speed(volts)), volts, rtol=1e-12)
    slopes = [jax.grad(wind.thrust_per_speed)(x) for x in (-1.0, 0.0, 1e-3, 1e3, 2e4)]
    assert np.isfinite(slopes).all() and slopes[-1] > 0.0


WIND = {"solar_wind.time": [0.0, 10.0, 25.0], "solar_wind.speed": [4e5, 5e5, 4.5e5],
        "solar_wind.number_density": [7.3e6, 4e6, 9e6]}  # fmt: skip


@pytest.mark.nightly
@pytest.mark.parametrize("law", quickly(reversed(LAWS)))
def test_the_thrust_stays(small, law, validate):
    """With the law constant-thrust a changing wind leaves the size of the thrust as asked. What remains is
    the bow of the tethers, whose square is 1e-5 here: 1e-4 is accepted. The voltage at the flat start has
    that thrust by the formula of the sheath as it is written."""
    given = small | WIND | PUSHED | (SHEATH if law == "debye-sheath" else {})
    run = esail.simulate("baseline", given, save=["thrust_O", "voltage"])
    size = np.linalg.norm(run["thrust_O"], axis=1)
    validate(
        f"THRUST-3 {law}", "sail in a changing wind, law constant-thrust", "the thrust asked for",
        "largest deviation", np.abs(size / 0.012 - 1.0).max(), 1e-4,
    )  # fmt: skip
    assert np.ptp(run["voltage"]) > 0.1 * np.mean(run["voltage"])
    if law == "debye-sheath":
        flat = (
            15e3
            * as_written(float(run["voltage"][0, 0]))
            * np.sqrt(1.0 + 3.0 * np.cos(np.deg2rad(10)) ** 2)
        )
        validate(
            "THRUST-2", "sail in the wind of a Debye sheath", "formula with constants of scipy",
            "thrust at the start", abs(flat / 0.012 - 1.0), 4e-3,
        )  # fmt: skip


def test_upper_limit_of_the_voltage():
    """The law keeps `voltage.maximum`."""
    from esail_jax.loads.constant_thrust import ConstantThrust
    from esail_jax.loads.voltage_limits import Limits
    from esail_jax.measurements import Measurements

    wind = SteadyWind(*AVERAGE)
    d = jnp.eye(3)[:, 1:]
    measured = Measurements(jnp.zeros(()), jnp.eye(3)[0], d, d, jnp.eye(3)[0])
    law = ConstantThrust(jnp.asarray(0.02), jnp.array([1e4, 2e4]), wind, Limits(None))
    volts = law.voltage(measured)
    assert np.allclose(4e5 * wind.thrust_per_speed(volts) * 3e4, 0.02, rtol=1e-12)
    limited = ConstantThrust(law.thrust, law.length, wind, Limits(jnp.asarray(5e3)))
    limited = limited.voltage(measured)
    assert limited.tolist() == [5e3, 5e3] and volts.min() > 5e3


@pytest.mark.parametrize("name", LAWS)
def test_derivatives_by_the_thrust(name):
    """Derivatives of the law's voltages by the thrust and the length of the tethers are difference
    quotients of fourth order to 1e-6, and both modes agree."""
    from esail_jax.loads.constant_thrust import ConstantThrust
    from esail_jax.loads.voltage_limits import Limits
    from esail_jax.measurements import Measurements

    d = jnp.eye(3)[:, 1:]
    measured = Measurements(jnp.zeros(()), jnp.eye(3)[0], d, d, jnp.eye(3)[0])

    def volts(x):
        law = ConstantThrust(x["thrust"], x["length"], SteadyWind(*AVERAGE, LAWS[name]), Limits(None))
        return {"volts": law.voltage(measured)}

    numbers = {"thrust": (0.012, 1e-4), "length": (np.array([1e4, 2e4]), np.array([100.0, -50.0]))}
    assert max(check_both_modes(volts, numbers).values()) < 1e-6


def test_gamma_distributed_pressure():
    """The pressure has the mean and the spread asked for, to the statistics of 1e4 independent instants,
    and its correlation falls off within the correlation time; it goes into a scene as it is."""
    wind = gamma_wind(3, 6e5, variation=0.6, interval=60.0, correlation_time=1.0)
    pressure = PROTON_MASS * wind["number_density"] * wind["speed"] ** 2
    assert abs(pressure.mean() / 2e-9 - 1.0) < 4 * 0.6 / 100.0
    assert abs(pressure.std() / pressure.mean() / 0.6 - 1.0) < 0.05
    skewness = ((pressure / pressure.mean() - 1.0) ** 3).mean() / (pressure.std() / pressure.mean()) ** 3
    assert abs(skewness - 2 * 0.6) < 0.2, "2/sqrt(k), that of a gamma distribution"
    slow = gamma_wind(3, 6e5, correlation_time=600.0)["number_density"]
    assert abs(np.corrcoef(slow[:-1], slow[1:])[0, 1] - np.exp(-0.1)) < 0.03
    short = gamma_wind(1, 20.0)
    scene = esail.load_scene("baseline", {"integrator.t_end": 20.0} | {
        f"solar_wind.{key}": x.tolist() for key, x in short.items()})  # fmt: skip
    assert scene.solar_wind.number_density is not None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"solar_wind.thrust_law": "cubic"}, r"`solar_wind.thrust_law` must be \"linear\" or \"debye-sh"),
        ({"solar_wind.thrust_law": "debye-sheath"},
         r"`solar_wind.cutoff_voltage` must be left out with the law debye-sheath, but is given"),
        ({"solar_wind.cutoff_voltage": None}, r"`solar_wind.cutoff_voltage` must be given, but is missing"),
        ({"solar_wind.tether_radius": 1e-5},
         r"`solar_wind.tether_radius` must be left out with the law linear, but is given"),
        ({**SHEATH, "solar_wind.tether_radius": None},
         r"`solar_wind.tether_radius` must be given with the law debye-sheath, but is missing"),
        ({**SHEATH, "solar_wind.electron_temperature_ev": 0.0},
         r"`solar_wind.electron_temperature_ev` must be positive, but is 0.0"),
        ({"voltage.law": "constant-thrust", "voltage.value": None},
         r"`voltage.thrust` must be given with the law constant-thrust, but is missing"),
        ({**PUSHED, "voltage.thrust": -1.0}, r"`voltage.thrust` must be positive, but is -1.0"),
        ({**SHEATH, "hub": None, "voltage.law": "planar-cone", "voltage.value": None,
          "voltage.coning_angle_deg": 5.0, "voltage.spin_rate": 4e-3},
         r"`solar_wind.thrust_law` must be linear with the law planar-cone"),
    ],
)  # fmt: skip
def test_bad_input(changes, message, nothing_compiles):
    """One line names the key before anything is compiled."""
    hub = {"hub.height": None, "hub.radius": None, "hub.density": None} if "hub" in changes else {}
    changes = {key: x for key, x in changes.items() if key != "hub"} | hub
    with pytest.raises(esail.SceneError, match=message):
        esail.load_scene("baseline", changes)
