"""Energy-momentum method (Simo & Tarnow 1992; Gonzalez 1996, 2000): implicit midpoint with a discrete
gradient.

    q1 = q0 + h u,      u = (v0 + v1)/2,      w = (v1 - v0)/h,      Phi(t1, q1) = 0
    M w + DU(q0, q1) + Phi_q(t_m, q_m)^T lam = Q(t_m, q_m, u),      q_m = (q0 + q1)/2

Without loads and damping the method conserves energy, momentum and angular momentum for every step size: DU
. (q1 - q0) is the change of U. The constraints are quadratic in q, so that Phi_q(q_m) (q1 - q0) is Phi(q1)
- Phi(q0), and they do no work. The order is two, and there is no numerical damping: vibrations, also those
of the hub's multipliers, do not decay. The multipliers are of second order only as the mean of two steps.

The unknowns are w and lam. The error of the balance is that of the iterations, which therefore continue to
rounding. The factors of a block are rotated as in `fixed_step.py`.
"""

import dataclasses
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax import iteration_matrix
from esail_jax.array_types import Float, Instants, Rotation, Scalar
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.numerics import bordered, structured
from esail_jax.numerics.quadrature import gauss_legendre
from esail_jax.point_fields import PointFields
from esail_jax.steppers.fixed_step import FixedStep
from esail_jax.steppers.fixed_step_solution import solve_step
from esail_jax.steppers.fixed_step_state import FrozenFactors, IterationInfo, StepState, Unknowns
from esail_jax.system import Power, Residual, System
from esail_jax.terms import Term

ROUNDING = 1e-13
"""Largest last increment of a converged step, relative to the size of the coordinates. An iteration reduces
the error at least by a factor of ten, so that rounding remains."""

PATH_POINTS = 4
"""Number of Gauss points between two states. It is exact for Green-Lagrange strain, and exact to rounding
for any smooth energy of a tether whose r_x . r_x changes by less than a tenth within a step."""


class Secant(Term):
    """The discrete gradient of an energy between the fields at the start and at the end of a step.

    W depends on scalar products c of the fields only. Its mean gradient on the straight way in c from
    start to end, G = int_0^1 dW/dc dtau, has G . (c1 - c0) = W1 - W0 without any division, and acts on the
    mean fields, so that it exerts no moment on them. Fields with the products (1 - tau) c0 + tau c1 are

        X = (sqrt(1 - tau) x0, sqrt(tau) x1),

    two vectors stacked: the density takes them as it is, where the cable is straight too, and the two
    parts of its gradient g, divided by the same roots, add up to twice the discrete gradient.
    """

    term: Term
    start: PointFields

    name: ClassVar[str] = "secant"

    @property
    def depends_on(self) -> tuple[str, ...]:
        return self.term.depends_on

    def point_forces(self, time: Instants, fields: PointFields, rates: PointFields) -> PointFields:
        """The forces conjugate to the fields at the midpoint, which also give the fields at the
        end."""
        tau, weights = gauss_legendre(PATH_POINTS)
        roots = np.sqrt(np.stack([1.0 - tau, tau]))

        def stacked(start, middle):
            pair = jnp.stack([start, 2.0 * middle - start])
            spread = roots.reshape(2, 1, -1, *(1,) * (start.ndim - 1)) * pair[:, :, None]
            return spread.reshape(-1, *spread.shape[2:])

        def gathered(gradient):
            parts = gradient.reshape(2, -1, *gradient.shape[1:])
            return 0.5 * jnp.einsum("st,sct...->c...", weights / roots, parts)

        path = jax.tree.map(stacked, self.start, fields)
        return jax.tree.map(gathered, self.term.point_forces(time, path, path))

    def thermal_part(self, time: Instants) -> "Secant | None":
        """The discrete gradient of the part that depends on the temperature."""
        part = self.term.thermal_part(time)
        return None if part is None else Secant(part, self.start)


class Middle(NamedTuple):
    """The midpoint of a step. system: with secants as energies; u = (q1 - q0)/h, w = (v1 - v0)/h."""

    system: System
    time: Scalar
    q: Coordinates
    u: Coordinates
    w: Coordinates


class EnergyMomentum(FixedStep):
    """The energy-momentum method. step_size [s]. In a `StepState`, a is w of the last step, power is that
    at its midpoint, and vdot is an estimate for its end."""

    name: ClassVar[str] = "energy-momentum"
    most_iterations: ClassVar[int] = 30

    @property
    def phase_error(self) -> Scalar:
        """The coefficient 1/12 of the midpoint rule: 2 arctan(h omega/2) = h omega - (h omega)^3/12."""
        return jnp.asarray(1.0 / 12.0)

    @property
    def _q_share(self) -> Scalar:
        """The derivative s = d q_m / d w [s^2]; the iteration matrix is M + s K + ... ."""
        return 0.25 * self.step_size**2

    @property
    def _rate_factor(self) -> Scalar:
        """The derivative d u / d q_m [1/s]."""
        return 2.0 / self.step_size

    def factor(
        self, system: System, time: Scalar, q: Coordinates, v: Coordinates, lam: Multipliers
    ) -> FrozenFactors:
        """The iteration matrix of a step at constant velocity from a state, with its factors."""
        h = self.step_size
        middle, end = q.axpy(0.5 * h, v), q.axpy(h, v)
        matrix = self.matrix(system, time + 0.5 * h, middle, v, lam, time + h, end)
        return FrozenFactors(matrix, structured.factor(matrix), system.rotation(time, q))

    def matrix(
        self,
        system: System,
        time: Scalar,
        q: Coordinates,
        u: Coordinates,
        lam: Multipliers,
        end: Scalar,
        q1: Coordinates,
    ) -> bordered.Bordered:
        """The iteration matrix: M + s (K + c C) and Phi_q^T at the midpoint, Phi_q at the end."""
        matrix = iteration_matrix.tangent(system, time, q, u, lam, self._q_share, self._rate_factor)
        last = iteration_matrix.mass(system, end, q1)
        if system.hub is not None:
            matrix = matrix._replace(border=matrix.border.at[12:, :12].set(last.border[12:, :12]))
        if system.clamped:
            matrix = matrix._replace(local=matrix.local.at[3:, :3].set(last.local[3:, :3]))
        if system.clamped and system.hub is not None:
            moved = matrix.local_border.at[3:].set(last.local_border[3:])
            matrix = matrix._replace(local_border=moved)
        return matrix

    def attitude(
        self, system: System, end: Scalar, q0: Coordinates, v0: Coordinates, w: Coordinates
    ) -> Rotation:
        """The attitude at the start of the step, for which the factors are made."""
        return system.rotation(end - self.step_size, q0)

    def end_of_step(
        self, system: System, end: Scalar, q0: Coordinates, v0: Coordinates, w: Coordinates
    ) -> tuple[Coordinates, Coordinates]:
        """q and v at the end of the step, with the roots set from the hub or the frame."""
        h = self.step_size
        q, v = q0.axpy(h, v0.axpy(0.5 * h, w)), v0.axpy(h, w)
        return system.place_roots(end, q), system.place_roots(end, v, derivative=1)

    def middle(
        self, system: System, end: Scalar, q0: Coordinates, v0: Coordinates, w: Coordinates
    ) -> Middle:
        """The midpoint of a step. Roots of a rotating frame have the mean rates of the step, which
        are those along a chord."""
        h = self.step_size
        w = system.place_roots(end, w, derivative=2)
        u = v0.axpy(0.5 * h, w)
        if framed(system):
            q1, v1 = self.end_of_step(system, end, q0, v0, w)
            u = with_roots(u, (roots_of(q1) - roots_of(q0)) / h)
            w = with_roots(w, (roots_of(v1) - roots_of(v0)) / h)
        start = system.tethers.interpolate(q0.tether)
        # They stand in the place of energies, and give forces only.
        secants: tuple[Any, ...] = tuple(Secant(term, start) for term in system.energies)
        system = dataclasses.replace(system, energies=secants)
        if system.ring is not None:
            before = system.ring.segments.interpolate(system.ring.nodal(q0))
            secants = tuple(Secant(term, before) for term in system.ring.energies)
            system = dataclasses.replace(system, ring=dataclasses.replace(system.ring, energies=secants))
        return Middle(system, end - 0.5 * h, q0.axpy(0.5 * h, u), u, w)

    def residual(
        self, system: System, end: Scalar, q0: Coordinates, v0: Coordinates, unknowns: Unknowns
    ) -> tuple[Residual, Power]:
        """The equations of motion at the midpoint and the constraints at the end, and the power,
        which is the work of the step over h."""
        made, time, q, u, w = self.middle(system, end, q0, v0, unknowns.vdot)
        (forces, constraints), power = made.residual(time, q, u, w, unknowns.lam)
        if system.has_constraints:
            q1, _ = self.end_of_step(system, end, q0, v0, unknowns.vdot)
            constraints = system.constraints(end, q1)
        if framed(system):
            _, v1 = self.end_of_step(system, end, q0, v0, unknowns.vdot)
            # Kinetic energy changes with the mean velocity of the roots, not with that on the chord.
            slip = 0.5 * (roots_of(v0) + roots_of(v1)) - roots_of(u)
            external = power.external + (slip * system.tethers.inertia(w.tether)[0, :, 0]).sum()
            if system.clamped:
                # The work of a moving clamp also differs from that of its motion at the midpoint.
                turning = jax.jvp(made.constraints, (time, q), (jnp.ones(()), u))[1].clamp
                external = external - (unknowns.lam.clamp * turning).sum()
            power = power._replace(external=external)
        return Residual(forces, constraints), power

    def correct(
        self, system: System, residual: Residual, factors: FrozenFactors, turned: Rotation
    ) -> tuple[Unknowns, Coordinates]:
        """The change of the unknowns in an iteration, and the corresponding change of q1. It is
        twice the change of q_m, to which the matrix belongs."""
        s = self._q_share
        forces = jax.tree.map(lambda r: -s * r, residual.forces)
        constraints = jax.tree.map(lambda r: -0.5 * r, residual.constraints)
        dq, dlam = factors.solve(system, turned, forces, constraints)
        change = jax.tree.map(lambda x: x / s, Unknowns(dq, dlam))
        return change, jax.tree.map(lambda x: 2.0 * x, dq)

    def tangent(
        self, system: System, end: Scalar, q0: Coordinates, v0: Coordinates, unknowns: Unknowns
    ) -> FrozenFactors:
        """The factors of the exact derivative of the residual: forces at the midpoint, constraints
        at the end."""
        made, time, q, u, _ = self.middle(system, end, q0, v0, unknowns.vdot)
        q1, _ = self.end_of_step(system, end, q0, v0, unknowns.vdot)
        matrix = self.matrix(made, time, q, u, unknowns.lam, end, q1)
        return FrozenFactors(matrix, structured.factor(matrix), jnp.eye(3))

    def tolerances(self, system: System, q: Coordinates) -> Float[jax.Array, "2"]:
        """The largest last increments [m] of a converged step, of tether nodes and of the hub."""
        size = jnp.maximum(jnp.abs(q.tether[0]).max(), system.tethers.element_length.max())
        return lax.stop_gradient(ROUNDING * jnp.stack([size, size]))

    def step(
        self, system: System, time: Scalar, state: StepState, factors: FrozenFactors, rate: Scalar
    ) -> tuple[StepState, IterationInfo]:
        """Takes a step from t to t + h, with iterations until only rounding errors remain."""
        h = self.step_size
        end = time + h
        guess = jax.tree.map(
            lambda *x: x[0] + x[1] + x[2], state.a, state.vdot_difference, state.vdot_second_difference
        )
        unknowns = Unknowns(guess, state.lam)
        unknowns, power, info = solve_step(self, system, end, state.q, state.v, unknowns, factors, rate)
        q, v = self.end_of_step(system, end, state.q, state.v, unknowns.vdot)
        w = unknowns.vdot
        difference = jax.tree.map(jnp.subtract, w, state.a)
        state = StepState(
            q=q,
            v=v,
            vdot=w.axpy(0.5, difference),
            a=w,
            lam=unknowns.lam,
            vdot_difference=difference,
            vdot_second_difference=jax.tree.map(jnp.subtract, difference, state.vdot_difference),
            work=jax.tree.map(lambda total, rate: total + h * rate, state.work, power),
            power=power,
        )
        return state, info


def framed(system: System) -> bool:
    """Tells whether the roots are on a frame with prescribed rotation."""
    return system.hub is None and system.roots is not None


def roots_of(x: Coordinates) -> Float[jax.Array, "3 tether"]:
    """The values at the root nodes."""
    return x.tether[0, :, 0]


def with_roots(x: Coordinates, values: Float[jax.Array, "3 tether"]) -> Coordinates:
    """x with other values at the root nodes."""
    return x._replace(tether=x.tether.at[0, :, 0].set(values))
