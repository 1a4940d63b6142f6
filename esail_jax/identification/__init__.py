"""Identification: numbers of a scene from the telemetry of its run, with their uncertainty.

from esail_jax.identification import fit, information
result = fit("sail.toml", "telemetry.csv", ["solar_wind.thrust_factor"], {"spin_rate[2]": 1e-7})
names, matrix = information("sail.toml", ["solar_wind.thrust_factor"], {"spin_rate[2]": 1e-7})
"""

from esail_jax.identification.fit import Fit, fit
from esail_jax.identification.goal import Information
from esail_jax.identification.information import information
from esail_jax.identification.priors import Prior
from esail_jax.identification.uncertainty import Weakest

__all__ = ["Fit", "Information", "Prior", "Weakest", "fit", "information"]
