"""A constant torque on the hub: of a disturbance, or of a thruster that fires."""

from typing import ClassVar

import jax.numpy as jnp

from esail_jax.array_types import Vector
from esail_jax.terms import HubLoad, HubMotion


class HubTorque(HubLoad):
    """A torque that is constant in the axes of the hub. torque: [N m], in B. It has the power T . omega."""

    torque: Vector

    name: ClassVar[str] = "hub torque"

    def wrench(self, hub: HubMotion) -> tuple[Vector, Vector]:
        return jnp.zeros(3), self.torque
