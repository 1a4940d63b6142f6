"""The tables that sails and chains share: gravity, time integration and saved instants."""

from esail_jax.scenes.declarations import declare, table, vector
from esail_jax.scenes.methods import MethodName
from esail_jax.scenes.rules import between, choice, positive
from esail_jax.scenes.value_types import Number, Vector


@table
class Gravity:
    """Uniform gravity in the inertial frame."""

    acceleration: Vector = vector(unit="m/s^2", doc="Acceleration of gravity in inertial axes.")


@table
class Integrator:
    """Time integration. Without `method` the package chooses one: collocation for a sail, for a chain an
    explicit method, or an implicit one if its rods vibrate fast. The method chooses its step or
    tolerance."""

    t_end: float = declare(positive, structure=True, unit="s", doc="End time.")
    method: MethodName | None = declare(
        choice(MethodName), unit="-", doc="Method of time integration; chosen if left out.", default=None
    )
    step: float | None = declare(
        positive,
        structure=True,
        unit="s",
        doc="Fixed step size; methods with error control then use it in place of a tolerance.",
        default=None,
    )
    spectral_radius: Number | None = declare(
        between("[0, 1]"),
        unit="-",
        doc="Spectral radius of generalized-alpha at infinite frequency.",
        default=None,
    )
    tolerance: Number | None = declare(
        between("[1e-16, 1)"),
        unit="-",
        doc="Relative local error of methods with error control.",
        default=None,
    )


@table
class Output:
    """Instants at which observables are saved."""

    interval: float = declare(
        positive,
        structure=True,
        unit="s",
        doc="Time between saved instants; t_end/1000 without this table.",
    )
