"""The table of a sail's orbit about the Sun."""

from esail_jax.scenes.declarations import declare, table
from esail_jax.scenes.rules import nonzero_vector
from esail_jax.scenes.value_types import Shape, Vector


@table
class HeliocentricOrbit:
    """Kepler orbit about the Sun of the origin of the inertial frame, whose axes do not turn. The hub
    starts on it."""

    position_au: Vector = declare(
        nonzero_vector, shape=Shape.VECTOR, unit="au", doc="Heliocentric position of the hub at t = 0."
    )
    velocity: Vector = declare(
        nonzero_vector, shape=Shape.VECTOR, unit="m/s", doc="Heliocentric velocity of the hub at t = 0."
    )
