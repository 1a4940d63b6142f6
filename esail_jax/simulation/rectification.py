"""Rectification of the orbit of a sail (Encke's method; Battin 1987, Sec. 8.4).

The coordinates of a sail on an orbit are relative to an origin that moves on a Kepler orbit. The thrust
moves a light sail away from it: by 1e6 m in a day, by 1e10 m in a year. Numbers of the latter size are
rounded to 2e-6 m, which is seen in the strain. At some switch times (`schedule.switch_times`) the origin
therefore moves to the hub, on the Kepler orbit through the position and the velocity of the hub at that
instant. Output remains relative to the orbit of the scene (`observables.Instant`).
"""

from typing import NamedTuple

from esail_jax.array_types import Array, Bool, Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.environment.kepler_orbit import KeplerOrbit
from esail_jax.numerics.lockstep import select
from esail_jax.observables import kinetic_energy
from esail_jax.steppers.stepper import Point
from esail_jax.system import Power, System

FAR = 1e5
"""Distance [m] of the hub from the origin beyond which the origin moves: there coordinates are rounded to
1.5e-11 m. The sail itself is of this size."""


class PointOnOrbit(NamedTuple):
    """An instant of the motion of a sail on an orbit: the fields of `Point`, and the Kepler orbit on which
    the origin of q and v moves. It is the final state of such a run."""

    time: Scalar
    q: Coordinates
    v: Coordinates
    work: Power
    exact: Bool[Array, ""]
    orbit: KeplerOrbit

    @classmethod
    def of(cls, point: Point, orbit: KeplerOrbit | None) -> "AnyPoint":
        """The point with an orbit, or as it is if there is none."""
        return point if orbit is None else cls(*point, orbit)

    def parts(self) -> tuple[Point, KeplerOrbit]:
        """The point and the orbit."""
        return Point(*self[:-1]), self.orbit


AnyPoint = Point | PointOnOrbit
"""The final state of a run, from which another run may start."""


def rectified(system: System, point: Point, orbit: KeplerOrbit) -> tuple[Point, KeplerOrbit]:
    """A point and the orbit on which the origin of its coordinates moves, after the origin has
    moved to the hub if that was farther away than FAR.

    The external work of the new point is smaller by the kinetic energy that it has lost, so that the energy
    balance is the same."""
    position, velocity = system.hub.centre(point.q.hub), system.hub.centre(point.v.hub)
    q = point.q.axpy(-1.0, system.uniform(position))
    v = point.v.axpy(-1.0, system.uniform(velocity))
    now = system.paid_out(point.time, point.q, point.v)
    lost = kinetic_energy(now, point.v, q) - kinetic_energy(now, v, q)
    work = point.work._replace(external=point.work.external - lost)
    place, motion = orbit.at(point.time)
    moved = (
        point._replace(q=q, v=v, work=work),
        KeplerOrbit(place + position, motion + velocity, point.time),
    )
    return select(position @ position > FAR**2, moved, (point, orbit))
