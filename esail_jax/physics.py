"""Physics of your own: the kinds of term that a user may write and add to any scene.

    from esail_jax.physics import HubLoad

    class Thruster(HubLoad):
        thrust: Array                                    # N, along X_B

        def wrench(self, hub):
            return hub.rotation[:, 0] * self.thrust, jnp.zeros(3)

    esail.simulate("baseline", terms=[Thruster(0.01)])

A term is an `equinox.Module` of one of these kinds, with one method that reads like its equation:

| kind | method | gives |
|---|---|---|
| `Energy` | `deformation(invariants)`, `energy_density(e)` | elastic energy of the tethers [J/m] |
| `Dissipation` | `deformation(invariants)`, `rayleigh_density(e, rate)` | half the dissipated power [W/m] |
| `Load` | `force(time, fields, rates)` | force per undeformed length of the tethers [N/m] |
| `TipLoad` | `force(measurements)` | force on every remote unit [N] |
| `HubLoad` | `wrench(hub)` | force at the hub's centre [N] and torque about it [N m] |
| `Field` | `acceleration(time, position, velocity)` | acceleration of everything that has mass [m/s^2] |
| `WinchLaw` | `tension(measurements)` | tension that every motor of a winch holds [N] |

The term is added to those of the scene. Arrays have the component first. Those of the tethers end with the
axes (element, tether), so that a number per tether, of shape (tether,), needs no care; what stands between
is a batch. Every floating-point number of a term is a parameter: other values need no compilation, and have
derivatives. Integers and texts are part of the structure. `jnp` takes the place of numpy, `jnp.where` that
of `if`.

A term should be continuous in time. Instants [s] at which it changes its form, such as the ends of a ramp,
belong into the property `knots`, a sequence of numbers or arrays: steps with error control end there.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from esail_jax import terms
from esail_jax.array_types import Array, Float
from esail_jax.terms import HubMotion

__all__ = [
    "Dissipation",
    "Energy",
    "Field",
    "HubLoad",
    "HubMotion",
    "Load",
    "LoadFields",
    "TipLoad",
    "WinchLaw",
]


class LoadFields(NamedTuple):
    """The fields that a load may depend on, each of shape (3, point, .., element, tether), or their rates.

    r: position [m] in I. r_x: slope dr/dx [-]. r_xx: second derivative [1/m], None unless the load names it
    in `depends_on`. x: undeformed distance from the root [m], of shape (point, .., element, tether).
    """

    r: Float[Array, "3 *point"]
    r_x: Float[Array, "3 *point"]
    r_xx: Float[Array, "3 *point"] | None
    x: Float[Array, "*point"]


class Named(eqx.Module):
    """A term whose name is that of its class."""

    @property
    def name(self) -> str:
        return type(self).__name__


class Energy(Named, terms.Energy):
    """Elastic energy of the tethers per undeformed length.

    `deformation(invariants)` is a measure of deformation e, a function of `invariants.stretch_squared`
    |r_x|^2 and, for cables with bending, `invariants.normal_squared` [1/m^2]; `energy_density(e)` is W
    [J/m].
    """

    @property
    def depends_on(self) -> tuple[str, ...]:
        return fields_of(self)


class Dissipation(Named, terms.Dissipation):
    """Rayleigh dissipation of the tethers per undeformed length.

    `deformation(invariants)` is that of `Energy`; `rayleigh_density(e, rate)` is R [W/m], quadratic in the
    rate of e. The dissipated power is 2 R.
    """

    @property
    def depends_on(self) -> tuple[str, ...]:
        return fields_of(self)


class Load(Named, terms.Load):
    """Force on the tethers per undeformed length.

    `force(time, fields, rates)` is f [N/m], of the shape of `fields.r_x`; `fields` and `rates` are
    `LoadFields`.

    A load may also have `commanded(measurements)`, a number for every tether that depends on the state. Its
    result is found in `self.command` within `force`. `measurements` is that of voltage laws; its `current`
    is the electron current of every tether at the root [A], for scenes with `tethers.wire_radius`.
    """

    @property
    def depends_on(self) -> tuple[str, ...]:
        """The fields that the force depends on: position and slope."""
        return ("r", "r_x")

    @property
    def knots(self) -> tuple[Any, ...]:  # type: ignore[override]
        """Instants [s] at which the force changes its form in time. Steps end there."""
        return ()


class TipLoad(Named, terms.TipLoad):
    """Force on every remote unit: `force(measurements)` is of shape (3, tether) [N], in I.

    `measurements` is that of voltage laws (`measurements.Measurements`).
    """


class HubLoad(Named, terms.HubLoad):
    """Force and torque on the hub: `wrench(hub)` is the force (3,) [N] at the hub's centre, in I, and the
    torque (3,) [N m] about it, in B. `hub` is a `HubMotion`."""


class Field(Named, terms.Field):
    """Acceleration of everything that has mass: `acceleration(time, position, velocity)` [m/s^2].

    position [m] and velocity [m/s] are arrays with the component first, in I; so is the result.
    """


class WinchLaw(Named, terms.WinchLaw):
    """What the motors of winches hold, for scenes with the law "tension" of [deployment]:
    `tension(measurements)` [N], one number per tether, or one for all; positive against payout. It is added
    to the table `deployment.tension`, which may be left out.

    `measurements` is that of voltage laws, with `deployed_length` [m], `payout_rate` [m/s] and
    `root_tension` [N] of every tether. A law with an attribute `period` [s] is sampled, and its tensions
    are held in between; it may then have `init(measurements)`, the memory at the start, and
    `update(measurements, memory)`, the tensions and the next memory, in place of `tension`. A motor that
    holds a rate, with a gain k [N s/m]:

        class HoldRate(WinchLaw):
            rate: Array
            gain: Array
            torque: Array

            def tension(self, measurements):
                return self.torque + self.gain * (measurements.payout_rate - self.rate)
    """


def fields_of(term: terms.Deformation) -> tuple[str, ...]:
    """The fields that a measure of deformation depends on: the slope, and its derivative if the measure
    cannot do without the curvature."""
    try:
        measure = term.deformation(terms.Invariants(jnp.ones(()), None))
    except (AttributeError, TypeError):
        return ("r_x", "r_xx")
    except Exception:  # an error of the method, which its call reports
        return ("r_x",)
    return ("r_x", "r_xx") if measure is None else ("r_x",)
