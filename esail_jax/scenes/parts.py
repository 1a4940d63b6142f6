"""The attributes of a scene that its checks read."""

from typing import Any, Protocol, runtime_checkable

from esail_jax.scenes import rules
from esail_jax.scenes.chain_tables import Chain, ChainInitial, ChainVoltage, ChainWind, Orbit, PlasmaBrake
from esail_jax.scenes.common_tables import Integrator
from esail_jax.scenes.orbit_table import HeliocentricOrbit
from esail_jax.scenes.sail_tables import (
    Event,
    Hub,
    Initial,
    SolarWind,
    Tethers,
    Voltage,
)
from esail_jax.scenes.thermal_table import Thermal
from esail_jax.scenes.tip_tables import AuxiliaryTethers, TipThrust


@runtime_checkable
class Parts(Protocol):
    """The attributes of a `Scene` that the checks read."""

    main: str
    initial: Initial | ChainInitial
    integrator: Integrator
    tethers: Tethers | None
    chain: Chain | None
    hub: Hub | None
    solar_wind: SolarWind | ChainWind | None
    voltage: Voltage | ChainVoltage | None
    event: Event | None
    auxiliary_tethers: AuxiliaryTethers | None
    orbit: Orbit | HeliocentricOrbit | None
    plasma_brake: PlasmaBrake | None
    tip_thrust: TipThrust | None
    thermal: Thermal | None
    voltage_law: Any
    terms: Any

    @property
    def members(self) -> rules.Members: ...
