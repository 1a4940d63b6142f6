"""Thermal strain of the tethers: exact cases, an independent simulator, energy, and derivatives."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.constants import STEFAN_BOLTZMANN
from esail_jax.elements.thermal import SteadyTemperature, ThermalEnergy
from esail_jax.environment.thermal import (
    ALUMINIUM,
    eclipse_series,
    eclipse_temperature,
    solar_flux,
    thermal_toml,
    visible_fraction,
)
from esail_jax.numerics.lines_in_time import LinesInTime
from esail_jax.observables import elastic_energy
from esail_jax.observables.run_warning import slack_warning
from esail_jax.scenes.build import build
from esail_jax.scenes.structure import split
from esail_jax.scenes.toml_text import to_toml
from support.derivatives import check_both_modes
from support.one_tether import STEPPERS, integrate, one_tether, straight
from support.quick import jit, quickly
from support.ring_sail import TIGHT, check_second_order, reference, ring_scene
from support.whole_runs import check_resumed_bits

KNOTS = [2.0, 7.0, 23.0, 31.0, 52.0]
TABLE = [
    [330.0, 325.0, 320.0, 330.0, 310.0],
    [330.0, 330.0, 325.0, 330.0, 320.0],
    [150.0, 180.0, 150.0, 165.0, 150.0],
    [150.0, 170.0, 150.0, 160.0, 155.0],
    [320.0, 330.0, 310.0, 330.0, 325.0],
]
HEAT = {
    "thermal.expansion": 2.3e-5,
    "thermal.reference_temperature": 300.0,
    "thermal.temperature": TABLE,
    "thermal.time": KNOTS,
}
"""An eclipse of half a minute, with its own temperatures for each of the five tethers. The thermal strain
changes by 4e-3; the elastic strain at the start is about 8e-3."""


def heated(system, expansion, temperature):
    """The system of one tether with a temperature, about a reference of 300 K."""
    axial = system.energies[0]
    numbers = jnp.asarray(expansion), jnp.asarray(300.0), temperature
    energy = ThermalEnergy(axial.stiffness, *numbers, axial.strain, system.tethers.elements)
    return dataclasses.replace(system, energies=(energy, *system.energies[1:]))


# ---- exact cases ------------------------------------------------------------------------------------


@pytest.mark.parametrize("stepper", quickly(STEPPERS, ("collocation",)))
def test_hanging_mass_on_a_wire_that_is_heated(stepper, validate):
    """A mass that hangs on a massless wire vibrates when the wire begins to warm at a constant rate.

    With engineering strain, m s'' = m g - EA (s/L - 1 - a (T - T_0)), T = T_1 + r t. From rest in balance,
    s = L (1 + m g/EA + a (T - T_0)) - (L a r/w) sin(w t), w^2 = EA/(m L), and the tension m (g - s'') is
    m g - m L a r w sin(w t). Methods of second order have phases that are wrong by (w h)^2 w t / 12 = 3e-4.
    """
    mass, g, length, axial, a, rate = 0.5, 2.0, 10.0, 50.0, 2e-4, 30.0
    omega, one = np.sqrt(axial / (mass * length)), lambda x: jnp.full((2, 1), x)
    series = LinesInTime.undivided(jnp.array([0.0, 100.0]), one(320.0).at[1].add(100.0 * rate))
    made = one_tether(
        kind="truss", elements=1, length=length, axial=axial, line_density=1e-12, tip_mass=mass,
        strain="engineering", gravity=[0.0, g, 0.0],
    )  # fmt: skip
    made = heated(made, a, series)
    at_rest = length * (1.0 + mass * g / axial + a * 20.0)
    q = straight(made, line=jnp.array([[[0.0], [at_rest]]]))
    v = jax.tree.map(jnp.zeros_like, q)
    time, q, _, _ = integrate(stepper, made, q, v, 0.01, 200)
    wave = np.sin(omega * time)
    exact = at_rest + length * a * rate * (time - wave / omega)
    found = q.tether[:, 0, 1, -1, 0]
    case, by = "mass on a wire that is heated", "s = L (1 + m g/EA + a (T - T_0)) - (L a r/w) sin(w t)"
    size = length * a * rate / omega
    validate(
        f"HEAT-1 {stepper}", case, by, "position / amplitude", np.abs(found - exact).max() / size, 1e-3
    )
    tension = axial * (found / length - 1.0 - a * (20.0 + rate * time))
    error = np.abs(tension - (mass * g - mass * length * a * rate * omega * wave)).max()
    size = mass * length * a * rate * omega
    validate(f"HEAT-2 {stepper}", case, by, "tension / amplitude", error / size, 1e-3)


def test_steady_start_of_a_heated_spinning_cable(validate):
    """The run starts from the balance of centrifugal force and elastic strain at the temperature of t = 0.

    With engineering strain, s'' = -k^2 s, k^2 = rho w^2/E, s(0) = R and EA (s'(L) - 1 - e) = m w^2 s(L),
    where e = a (T - T_0), hence s = R cos(k x) + B sin(k x). Five cubic elements miss it by 1e-12.
    """
    from esail_jax.scenes.structure import split
    from support.quick import build_jitted

    changes = {"tethers.count": 2, "tethers.strain": "engineering", "initial.spin_rate": 0.02}
    changes |= HEAT | {"thermal.temperature": [[150.0, 450.0], [300.0, 300.0]], "thermal.time": [0.0, 9.0]}
    scene = esail.load_scene("baseline", changes)
    q = build_jitted(*split(scene)).q.tether
    t, radius, w = scene.tethers, scene.hub.radius, scene.initial.spin_rate
    k, axial = w * np.sqrt(t.density / t.youngs_modulus), t.youngs_modulus * t.area
    x, pull = np.linspace(0.0, t.length, t.elements + 1), scene.remote_units.mass * w**2
    strain = 2.3e-5 * np.array([-150.0, 150.0])
    c, s = np.cos(k * t.length), np.sin(k * t.length)
    b = (axial * (1.0 + strain + radius * k * s) + pull * radius * c) / (axial * k * c - pull * s)
    exact = radius * np.cos(k * x)[:, None] + b * np.sin(k * x)[:, None]
    found = np.linalg.norm(np.asarray(q[0]), axis=0)
    case, by = "spinning cable at 150 and 450 K", "s = R cos(k x) + B sin(k x)"
    validate("HEAT-3", case, by, "positions, relative", np.abs(found / exact - 1.0).max(), 1e-10)


# ---- a run against independent results --------------------------------------------------------------


@pytest.mark.nightly
def test_run_follows_an_independent_integration(validate):
    """Every signal of five unequal tethers with a ring and temperatures of their own agrees with the
    independent code to 1e-6 of its range. Measured: 4e-8, dissipated power."""
    scene = ring_scene(HEAT | TIGHT)
    run = esail.simulate(scene)
    exact = reference(scene).run(np.asarray(run.time))
    table = np.stack([np.interp(run.time, KNOTS, column) for column in np.transpose(TABLE)], 1)
    exact |= {"temperature": table}
    found = {
        name: np.abs(np.asarray(run[name]) - values).max() / np.ptp(values)
        for name, values in exact.items()
    }
    worst = max(found, key=found.get)
    by = "independent NumPy code (`support/ring_reference.py`), Dormand & Prince 8(5,3)"
    quantity = f"worst of {len(found)} signals / range"
    validate("HEAT-4", "five unequal heated tethers with a ring", by, quantity, found[worst], 1e-6)
    balance = np.abs(run["energy_balance_error"]).max() / np.ptp(run["external_work"])
    validate(
        "HEAT-5",
        "five unequal heated tethers with a ring",
        "energy theorem",
        "energy / work",
        balance,
        1e-9,
    )


@pytest.mark.nightly
def test_energy_of_heating():
    """The energy-momentum method balances the energy of a sail whose temperatures change, to rounding: the
    work of heating is -N eps_T' per length. The work is zero at the start, its rate is the power, and a run
    that goes on from an instant of another one goes on with its work and its balance.

    Knots and saved instants are ends of steps. The power is compared with central differences of the work
    over two steps, which differ by the square of the step times the axial frequency, (0.1 s 0.14/s)^2.
    """
    rows = [[350.0, 330.0], [250.0, 280.0], [300.0, 320.0]]
    heat = {"thermal.expansion": 2.3e-5, "thermal.reference_temperature": 293.0}
    heat |= {"thermal.temperature": rows, "thermal.time": [2.0, 22.0, 47.0]}
    steps = {"integrator.method": "energy-momentum", "integrator.step": 0.1, "output.interval": 0.1}
    scene = two_tethers(heat | steps)
    run = esail.simulate(scene)
    work, balance = run["external_work"], np.abs(run["energy_balance_error"])
    assert balance.max() < 1e-11 * run["kinetic_energy"][0] and abs(work[0]) < 1e-12
    assert np.abs(work).max() > 1e-2
    away = np.array([not np.isclose(t, heat["thermal.time"], atol=0.2).any() for t in run.time[1:-1]])
    slope = (work[2:] - work[:-2]) / 0.2
    error = np.abs(slope - run["external_power"][1:-1])[away].max()
    assert error < 1e-3 * np.abs(slope).max()
    early = esail.simulate(scene, {"integrator.t_end": 30.0})
    later = esail.simulate(scene, start=early.final_state)
    rest = later["external_work"] - work[-len(later.time) :]
    assert np.abs(rest).max() < 1e-10 * np.abs(work).max()
    assert np.abs(later["energy_balance_error"]).max() < 1e-10 * run["kinetic_energy"][0]


@pytest.mark.nightly
def test_a_cooled_tether_under_tension_is_not_slack():
    """150 K below the reference a tether is shorter than undeformed, although the spin stretches it by
    9e-4: its strain is negative, its elastic strain is not, and the run warns of nothing. Pushed together
    by 2e-3 more, it is slack."""
    cold = {"thermal.expansion": 2.3e-5, "thermal.reference_temperature": 300.0}
    scene = two_tethers(cold | {"thermal.temperature": 150.0})
    run = esail.simulate(scene)
    assert (run["max_axial_strain"] < -2e-3).all() and run.stats["message"] == ""
    rows = {"max_axial_strain": run["max_axial_strain"] - 2e-3, "temperature": run["temperature"]}
    assert slack_warning(rows, scene.thermal).startswith("Tethers 1, 2 go slack")
    assert slack_warning({"max_axial_strain": rows["max_axial_strain"]}, scene.thermal) == ""


STEPS = {"integrator.t_end": 16.0, "thermal.time": [2.0, 3.05, 7.35, 31.0, 52.0]}
"""Two of these knots are in the middle of a step of 0.1 s, and all at the end of one of 0.05 s."""


@pytest.mark.nightly
def test_methods_with_fixed_steps_keep_their_order_at_kinks():
    """The errors of generalized-alpha and energy-momentum fall by 3.5 to 4.5 for half the step (order two:
    4), although the temperature has kinks within the longer steps; and energy-momentum, whose shorter
    steps end at the kinks, balances the energy to rounding, heating included."""
    run = check_second_order(HEAT | STEPS, ("energy_balance_error", "kinetic_energy", "external_work"))
    balance = np.abs(run["energy_balance_error"]).max()
    assert balance < 1e-10 * np.ptp(run["kinetic_energy"]) and np.ptp(run["external_work"]) > 1e-2


def test_series():
    """Temperatures are linear between knots, constant outside, and in a segment they follow its line also
    beyond its ends."""
    table = jnp.array([[300.0, 310.0], [200.0, 250.0], [260.0, 280.0]])
    series = LinesInTime.undivided(jnp.array([1.0, 3.0, 6.0]), table)
    times = jnp.array([-1.0, 1.0, 2.0, 3.0, 4.0, 6.0, 9.0])
    exact = np.stack([np.interp(times, series.time, column) for column in table.T], 1)
    assert np.allclose(series.at(times[:, None]), exact, rtol=0, atol=1e-12)
    assert np.array_equal(series.at(times[2]), series.at(times[:, None])[2])
    within = series.in_segment(np.array(1.0), np.array(3.0))
    assert np.allclose(within.at(jnp.asarray(3.5)), [175.0, 235.0], rtol=0, atol=1e-12)
    after = series.in_segment(np.array(6.0), np.array(np.inf))
    assert np.array_equal(after.at(jnp.asarray(5.9)), table[2])
    before = series.in_segment(np.array(0.0), np.array(1.0))
    assert np.array_equal(before.at(jnp.asarray(1.1)), table[0])
    steady = SteadyTemperature(table[0])
    assert np.array_equal(steady.at(times[0]), table[0])


# ---- derivatives, batches, resumed runs -----------------------------------------------------------------


def two_tethers(changes=()):
    """A sail of two tethers without wind."""
    calm = {f"solar_wind.{key}": None for key in ("speed", "number_density", "cutoff_voltage")}
    calm |= {"voltage.value": None, "tethers.count": 2, "tethers.element": "truss", "tethers.elements": 1}
    calm |= {"tethers.bending": False, "integrator.t_end": 60.0, "output.interval": 20.0}
    return esail.load_scene("baseline", calm | dict(changes))


NUMBERS = {
    "thermal.expansion": (np.array(2.3e-5), np.array(1e-6)),
    "thermal.reference_temperature": (np.array(293.0), np.array(5.0)),
    "thermal.temperature": (np.array([[350.0, 330.0], [150.0, 180.0], [300.0, 320.0]]),
                            np.array([[3.0, -2.0], [1.0, 2.0], [-2.0, 3.0]])),
    "thermal.time": (np.array([3.1, 22.3, 47.7]), np.array([0.2, -0.15, 0.1])),
}  # fmt: skip
"""Numbers of the table, and their changes in a difference quotient."""

NAMES = ("tip_position_I", "tether_length", "max_axial_strain", "elastic_energy", "external_work")


def end_of(numbers):
    """Signals at the end of a run."""
    run = esail.simulate(two_tethers({"integrator.tolerance": 1e-12}), numbers)
    return {name: run[name][-1] for name in NAMES}


def test_derivatives_by_steady_temperatures():
    """Derivatives of the steady start and its elastic energy by temperatures that do not change are
    difference quotients of fourth order to 1e-6, and both modes agree. (Those by a series are in
    `test_every_part.py`.)"""
    numbers = {
        "thermal.expansion": (2.3e-5, 1e-6),
        "thermal.reference_temperature": (293.0, 5.0),
        "thermal.temperature": (np.array([350.0, 330.0]), np.array([3.0, -2.0])),
    }
    scene = two_tethers({key: np.asarray(value).tolist() for key, (value, _) in numbers.items()})

    def signals(given):
        system, q, _, _ = build(*split(esail.load_scene(scene, given)))
        return {"tether": q.tether, "energy": elastic_energy(system, jnp.zeros(()), q)}

    assert max(check_both_modes(signals, numbers).values()) < 1e-6


@pytest.mark.nightly
def test_batch_equals_a_loop():
    """Members of a batch with other temperatures and instants are the runs of the host, also through the
    steady start. Steps of the host end at the instants, which are tracers in a batch."""
    given = {key: jnp.asarray(value) for key, (value, _) in NUMBERS.items()}
    moved = {key: jnp.asarray(value + change) for key, (value, change) in NUMBERS.items()}
    both = jax.tree.map(lambda *x: jnp.stack(x), given, moved)
    batch = jit(jax.vmap(end_of))(both)
    for member, numbers in enumerate((given, moved)):
        for name, exact in end_of({key: x.tolist() for key, x in numbers.items()}).items():
            assert np.allclose(batch[name][member], exact, rtol=1e-9, atol=1e-12), (member, name)


@pytest.mark.nightly
@pytest.mark.parametrize("method", ["collocation", "energy-momentum"])
def test_resumed_run_is_bit_identical(method, tmp_path):
    """A run that is continued from its file is that of one run, bit for bit, also between two knots."""
    step = {} if method == "collocation" else {"integrator.step": 0.1}
    given = {key: value.tolist() for key, (value, _) in NUMBERS.items()}
    scene = two_tethers(given | step | {"integrator.method": method, "output.interval": 6.0})
    file = tmp_path / "scene.toml"
    file.write_text(to_toml(scene))
    check_resumed_bits(file, (18, 30, 60), tmp_path)


# ---- the wire in sunlight -------------------------------------------------------------------------------


def test_wire_in_shadow(validate):
    """In sudden shadow a wire cools with 1/T^3 = 1/T_0^3 + 3 k t, k = 4 e sigma / (rho c d), from T_0^4 =
    a_s S / (pi e sigma); and half of the Sun's disc is visible when its centre is on the limb."""
    t = np.array([-5.0, 0.0, 10.0, 100.0, 999.0])
    flux = solar_flux(1.5)
    found = eclipse_temperature(ALUMINIUM, flux, t, 0.0, 1000.0, 0.0)
    k = 4.0 * 0.04 * STEFAN_BOLTZMANN / (2700.0 * 900.0 * 37e-6)
    start = (0.12 * 1361.0 / 2.25 / (np.pi * 0.04 * STEFAN_BOLTZMANN)) ** 0.25
    exact = (start**-3.0 + 3.0 * k * np.maximum(t, 0.0)) ** (-1.0 / 3.0)
    error = np.abs(found / exact - 1.0).max()
    validate("HEAT-7", "aluminium wire in shadow", "1/T^3 = 1/T_0^3 + 3 k t", "T, relative", error, 1e-7)
    light = visible_fraction(np.array([0.0, 1.0, 2.0, 3.0, 4.0, 50.0, 52.0, 54.0, 60.0]), 1.0, 50.0, 4.0)
    # With the limb half a radius from the centre, the smaller part is 1/3 - sqrt(3)/(4 pi) of the disc.
    part = 1.0 / 3.0 - np.sqrt(3.0) / (4.0 * np.pi)
    expected = [1.0, 1.0, 1.0 - part, 0.5, part, 0.0, 0.5, 1.0, 1.0]
    assert np.allclose(light, expected, rtol=0, atol=1e-12)


def test_series_of_an_eclipse_is_a_table_of_a_scene():
    """Straight lines between the instants of a series miss the temperature by the tolerance at most, and
    the TOML text of the series gives the same numbers in a scene."""
    import tomllib

    series = eclipse_series(ALUMINIUM, solar_flux(1.0), 100.0, 1000.0, 30.0, tolerance=0.5)
    time = np.linspace(0.0, 3000.0, 301)
    exact = eclipse_temperature(ALUMINIUM, solar_flux(1.0), time, 100.0, 1000.0, 30.0)
    assert np.abs(np.interp(time, series["time"], series["temperature"]) - exact).max() < 0.51
    assert len(series["time"]) < 60 and (np.diff(series["time"]) > 0.0).all()
    table = tomllib.loads(thermal_toml(series, 2.3e-5, 293.0))["thermal"]
    scene = esail.load_scene("baseline", {f"thermal.{key}": value for key, value in table.items()})
    assert np.array_equal(scene.thermal.temperature, series["temperature"])
    with pytest.raises(ValueError, match="`leave` must not be before"):
        eclipse_series(ALUMINIUM, 1361.0, 100.0, 110.0, 30.0)


# ---- bad input ----------------------------------------------------------------------------------------


TWO = {"thermal.expansion": 2e-5, "thermal.reference_temperature": 300.0, "thermal.temperature": 250.0}
SERIES = {"thermal.time": [0.0, 9.0], "thermal.temperature": [250.0, 200.0]}


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"thermal.temperature": -1.0}, r"`thermal.temperature` must not be negative, but is -1.0"),
        ({"thermal.reference_temperature": -1.0},
         r"`thermal.reference_temperature` must not be negative, but is -1.0"),
        ({"thermal.expansion": float("nan")}, r"`thermal.expansion` must be finite, but is nan"),
        ({"thermal.expansion": [1e-5, 1e-5]}, r"`thermal.expansion` must be a single number, but is \["),
        ({"thermal.temperature": [1.0, 2.0]},
         r"`thermal.temperature` must be a number or a list of 3 \(`tethers.count`\) without "
         r"`thermal.time`, but has 2 entries"),
        ({"thermal.temperature": [[1.0, 2.0, 3.0]]},
         r"`thermal.temperature` must be a number or a list of 3 \(`tethers.count`\) without "
         r"`thermal.time`, but is a table"),
        (SERIES | {"thermal.temperature": 250.0},
         r"`thermal.temperature` must have as many rows as `thermal.time` has instants \(2\), but is 250"),
        (SERIES | {"thermal.temperature": [1.0, 2.0, 3.0]},
         r"`thermal.temperature` must have as many rows as `thermal.time` has instants \(2\), but has 3"),
        (SERIES | {"thermal.temperature": [[1.0, 2.0], [1.0, 2.0]]},
         r"`thermal.temperature` must have rows of 3 \(`tethers.count`\), but has rows of 2"),
        (SERIES | {"thermal.temperature": [[1.0, 2.0], [1.0]]},
         r"`thermal.temperature` must be a number or a list of numbers, but is \["),
        (SERIES | {"thermal.time": [9.0, 9.0]}, r"`thermal.time` must increase, but is \[9.0, 9.0\]"),
        (SERIES | {"thermal.time": 9.0}, r"`thermal.time` must increase, but is 9.0"),
        ({"initial.elongation": "paper"},
         r"`initial.elongation` must be \"steady\" with \[thermal\], but is \"paper\""),
        ({"thermal.expansion": None}, r"`thermal.expansion` must be given, but is missing"),
    ],
)  # fmt: skip
def test_bad_input(overrides, message, nothing_compiles):
    """One line names the key before anything is compiled."""
    with pytest.raises(esail.SceneError, match=message) as refused:
        esail.load_scene("baseline", {"tethers.count": 3} | TWO | overrides)
    assert "\n" not in str(refused.value)
