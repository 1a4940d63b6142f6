"""What measurements would say of a sail: closed forms of its spin, and what is refused."""

import importlib

import numpy as np
import pytest

import esail_jax as esail
from esail_jax.constants import PROTON_MASS, THRUST_FACTOR, VACUUM_PERMITTIVITY
from esail_jax.identification import information
from esail_jax.identification.model import Prediction
from support.measured_sail import sail

STIFF = {
    "tethers.count": 2, "tethers.elements": 1, "tethers.length": 300.0, "remote_units.mass": 0.5,
    "tethers.youngs_modulus": 7e12, "hub.height": 1.0, "hub.radius": 1.0, "hub.density": 100.0,
    "initial.spin_rate": 0.05, "initial.sailing_angle_deg": 30.0, "integrator.t_end": 600.0,
    "integrator.tolerance": 1e-9,
}  # fmt: skip
"""Two tethers that hardly stretch: 1e-5 of their length under the spin."""


@pytest.mark.nightly
def test_a_torque_is_known_as_the_slope_of_a_line(validate):
    """The spin rate of a sail without thrust is omega_0 + T t / I: with a free bias, T has the variance of
    a slope, I^2 12 s^2 (N - 1) / (N (N + 1) t_end^2), with I = L / omega."""
    scene = esail.load_scene("truss", STIFF | {"voltage.value": 0.0})
    count, deviation, end = 201, 1e-7, 600.0
    run = esail.simulate(scene, times=[0.0, end], save=("angular_momentum_I", "spin_rate"))
    inertia = np.linalg.norm(run["angular_momentum_I"][0]) / run["spin_rate"][0, 1]
    _, matrix = information(
        scene, ["hub.torque[1]", "bias.spin_rate[2]"], {"spin_rate[2]": deviation},
        np.linspace(0.0, end, count),
    )  # fmt: skip
    found = np.linalg.inv(matrix)[0, 0]
    slope = 12.0 * deviation**2 * (count - 1) / (count * (count + 1) * end**2)
    error = abs(found / (inertia**2 * slope) - 1.0)
    validate(
        "IDF-1", "torque on the hub from the spin rate, with a free bias", "variance of a slope",
        "variance of the torque", error, 1e-3,
    )  # fmt: skip


@pytest.mark.nightly
def test_half_turns_of_voltage_change_the_spin_by_their_mean_torque(validate):
    """Tethers that are charged over half a turn change the spin by the mean torque of each,

        (1 / 2 pi) int_0^pi sigma u sin(alpha) sin(phi) dphi (L^2 / 2 + R L)
            = sigma u sin(alpha) (L^2 / 2 + R L) / pi,

    with roots at R from the axis and sigma = 0.18 (V - V_1) sqrt(eps_0 m_p n), which is what a fit of the
    thrust factor to a spin rate rests on. Over four whole turns, in which the axis turns by 6e-5 rad."""
    rise, volts, alpha = 1.0, 2e3, np.deg2rad(30.0)
    law = {
        "voltage.law": "phase-window", "voltage.value": volts, "voltage.on_phase_deg": -0.5 * rise,
        "voltage.off_phase_deg": 180.0 - 0.5 * rise, "voltage.rise_phase_deg": rise,
    }  # fmt: skip
    scene = esail.load_scene("truss", STIFF | law)
    end = 4.0 * 2.0 * np.pi / 0.05
    run = esail.simulate(scene, times=[0.0, end], save=("angular_momentum_I", "spin_rate"))
    inertia = np.linalg.norm(run["angular_momentum_I"][0]) / run["spin_rate"][0, 1]
    wind = scene.solar_wind
    sigma = THRUST_FACTOR * (volts - wind.cutoff_voltage)
    sigma *= np.sqrt(VACUUM_PERMITTIVITY * PROTON_MASS * wind.number_density)
    arm = 300.0**2 / 2.0 + 300.0 * 1.0
    rate = 2.0 * sigma * wind.speed * np.sin(alpha) * arm / np.pi / inertia
    growth = (run["spin_rate"][1, 1] - run["spin_rate"][0, 1]) / end
    validate(
        "IDF-2", "spin of a sail with voltage over half a turn", "mean torque of a turn",
        "change of the spin rate", abs(abs(growth) / rate - 1.0), 1e-3,
    )  # fmt: skip


REFUSALS = {
    "observable": ({"noise": {"spin_rat": 1.0}}, "`noise` must be given by observable of the run, such as "
                   "spin_rate, but has 'spin_rat'"),
    "place": ({"noise": {"spin_rate[3]": 1.0}}, "`noise` must name one of the 2 places of spin_rate, but "
              "has 'spin_rate[3]'"),
    "none": ({"noise": {}}, "`noise` must have an observable that is measured, but is empty"),
    "deviation": ({"noise": {"spin_rate": 0.0}}, "`noise[spin_rate]` must be positive and finite, but is "
                  "0.0"),
    "late": ({"times": [61.0]}, "`times` must be instants within the run, 0 to 60 s, but is [61.0]"),
    "no times": ({"times": []}, "`times` must be instants within the run, 0 to 60 s, but is []"),
    "bias of another": ({"free": ["bias.coning_angle[1]"]}, "`free` must name observables of the data "
                        "(spin_rate), but has bias.coning_angle"),
    "names": ({"free": []}, "`free` must be a list of keys, but is []"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSALS)
def test_a_wrong_argument_is_refused_before_anything_is_compiled(case, nothing_compiles):
    change, message = REFUSALS[case]
    given = {"free": ["hub.mass"], "noise": {"spin_rate": 1e-6}} | change
    with pytest.raises(esail.SceneError) as error:
        information(sail(), **given)
    assert str(error.value) == message


def test_a_run_that_fails_has_no_information(monkeypatch):
    """In place of a matrix of NaN."""
    module = importlib.import_module("esail_jax.identification.information")
    nothing = Prediction(np.full(26, np.nan), np.full((26, 1), np.nan))
    monkeypatch.setattr(module, "predictor", lambda *_: lambda values: nothing)
    with pytest.raises(esail.SimulationError, match="The run with its derivatives fails: see `esail run`"):
        information(sail(), ["hub.mass"], {"spin_rate": 1e-6})
