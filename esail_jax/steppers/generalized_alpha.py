"""Generalized-alpha for the index-3 equations (Arnold & Brüls 2007; [PGV] Eq. 12-15).

    M vdot_{n+1} + Phi_q^T lam_{n+1} = Q(t, q, v)_{n+1},      Phi(q_{n+1}) = 0
    (1 - alpha_m) a_{n+1} + alpha_m a_n = (1 - alpha_f) vdot_{n+1} + alpha_f vdot_n
    q_{n+1} = q_n + h v_n + h^2 ((1/2 - beta) a_n + beta a_{n+1})
    v_{n+1} = v_n + h ((1 - gamma) a_n + gamma a_{n+1})

The unknowns are vdot_{n+1} and lam_{n+1}, which the iterations of `fixed_step_solution.py` find. The first
guess is a quadratic extrapolation of vdot; one iteration per step is then enough for a smooth motion.
"""

from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from esail_jax import iteration_matrix
from esail_jax.array_types import Float, Rotation, Scalar
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.numerics import structured
from esail_jax.steppers.fixed_step import FixedStep
from esail_jax.steppers.fixed_step_solution import solve_step
from esail_jax.steppers.fixed_step_state import FrozenFactors, IterationInfo, StepState, Unknowns
from esail_jax.steppers.transposable import Transposable
from esail_jax.system import Power, Residual, System

POSITION_TOLERANCE = 1e-8
"""Largest remaining error of a nodal position, or of l r_x [m]."""

HUB_TOLERANCE = 1e-10
"""Largest remaining error of the hub's base points [m]: 1e-8 m would be an attitude error of 1e-8 rad."""

ROD_TOLERANCE, ROUNDING = 1e-11, 1e-14
"""Largest remaining error for rods, which may be short: ROD_TOLERANCE times the length of the shortest rod,
but at least ROUNDING times the length of the chain, the rounding error of positions. For a steel rod of
0.1 m, 1e-8 m would be a twentieth of its stretch under its own weight."""


class Parameters(NamedTuple):
    """The coefficients of the method, from its spectral radius rho_inf at infinite frequency."""

    alpha_m: Scalar
    alpha_f: Scalar
    beta: Scalar
    gamma: Scalar

    @classmethod
    def from_spectral_radius(cls, rho: Scalar) -> "Parameters":
        """The coefficients of [PGV] after Eq. 15 (where gamma is called mu, and beta nu)."""
        alpha_m = (2.0 * rho - 1.0) / (rho + 1.0)
        alpha_f = rho / (rho + 1.0)
        gamma = 0.5 + alpha_f - alpha_m
        return cls(alpha_m, alpha_f, 0.25 * (gamma + 0.5) ** 2, gamma)


class GeneralizedAlpha(FixedStep):
    """The generalized-alpha method. step_size [s]; spectral_radius: rho_inf in [0, 1)."""

    spectral_radius: Scalar

    name: ClassVar[str] = "generalized-alpha"
    trusted: ClassVar[float] = 1000.0
    """With 40 elements per tether, increments reach this limit. The relative change of the work is then
    1e-10, that of the dissipated energy 4e-7, and the number of iterations is half as large."""
    trials: ClassVar[int] = 2
    """The second trial step begins with the jerk that the first one gave."""

    @property
    def parameters(self) -> Parameters:
        return Parameters.from_spectral_radius(self.spectral_radius)

    @property
    def phase_error(self) -> Scalar:
        """The coefficient c = 1/12 + d (alpha_m - 1/2)/2 - 3 d^2/8 with d = alpha_m - alpha_f.

        It belongs to the modified equation q'' = vdot + 2 c h^2 d^2 vdot/dt^2, which follows from the
        expansion of the formulas above in h. c is 1/12 without dissipation (trapezoidal rule), and 11/24 at
        a spectral radius of 0 (Houbolt's method)."""
        c = self.parameters
        d = c.alpha_m - c.alpha_f
        return 1.0 / 12.0 + 0.5 * d * (c.alpha_m - 0.5) - 0.375 * d**2

    @property
    def _vdot_share(self) -> Scalar:
        """The derivative d a_{n+1} / d vdot_{n+1}."""
        c = self.parameters
        return (1.0 - c.alpha_f) / (1.0 - c.alpha_m)

    @property
    def _q_share(self) -> Scalar:
        """The derivative s = d q_{n+1} / d vdot_{n+1} [s^2]; the iteration matrix is M + s K + ... ."""
        return self.step_size**2 * self.parameters.beta * self._vdot_share

    def factor(
        self, system: System, time: Scalar, q: Coordinates, v: Coordinates, lam: Multipliers
    ) -> FrozenFactors:
        """The iteration matrix at a state ([PGV] Eq. 13, scaled by s) with its factors."""
        c = self.parameters
        rate_factor = c.gamma / (self.step_size * c.beta)
        matrix = iteration_matrix.tangent(system, time, q, v, lam, self._q_share, rate_factor)
        return FrozenFactors(matrix, structured.factor(matrix), system.rotation(time, q))

    def predict(self, state: StepState) -> tuple[Coordinates, Coordinates, Coordinates]:
        """q, v and a at the end of the step without the contribution of vdot_{n+1}."""
        c, h = self.parameters, self.step_size
        known = jax.tree.map(
            lambda vdot, a: (c.alpha_f * vdot - c.alpha_m * a) / (1.0 - c.alpha_m),
            state.vdot,
            state.a,
        )
        q = jax.tree.map(
            lambda q, v, a, k: q + h * v + h**2 * ((0.5 - c.beta) * a + c.beta * k),
            state.q, state.v, state.a, known,
        )  # fmt: skip
        v = jax.tree.map(
            lambda v, a, k: v + h * ((1.0 - c.gamma) * a + c.gamma * k), state.v, state.a, known
        )
        return q, v, known

    def end_of_step(
        self,
        system: System,
        end: Scalar,
        q0: Coordinates,
        v0: Coordinates,
        vdot: Coordinates,
    ) -> tuple[Coordinates, Coordinates]:
        """q and v at the end of the step for a given vdot there.

        The roots are set from the hub or the frame. No equation compares their positions with the hub's,
        and a difference from rounding would grow with the fourth power of time.
        """
        v_share = self.step_size * self.parameters.gamma * self._vdot_share
        q, v = q0.axpy(self._q_share, vdot), v0.axpy(v_share, vdot)
        return system.place_roots(end, q), system.place_roots(end, v, derivative=1)

    def attitude(
        self, system: System, end: Scalar, q0: Coordinates, v0: Coordinates, vdot: Coordinates
    ) -> Rotation:
        """The attitude at the predicted end of the step."""
        q, _ = self.end_of_step(system, end, q0, v0, vdot)
        return system.rotation(end, q)

    def residual(
        self, system: System, end: Scalar, q0: Coordinates, v0: Coordinates, unknowns: Unknowns
    ) -> tuple[Residual, Power]:
        """The residual of the equations at the end of the step, and the power of the forces
        there."""
        vdot = unknowns.vdot
        if system.hub is not None and system.roots.azimuth is not None:
            vdot = system.place_roots(end, vdot, derivative=2)  # for derivatives by the places of the roots
        q, v = self.end_of_step(system, end, q0, v0, vdot)
        return system.residual(end, q, v, vdot, unknowns.lam)

    def correct(
        self, system: System, residual: Residual, factors: FrozenFactors, turned: Rotation
    ) -> tuple[Unknowns, Coordinates]:
        """The change of the unknowns in an iteration, and the corresponding change of q."""
        s = self._q_share
        forces = jax.tree.map(lambda r: -s * r, residual.forces)
        constraints = jax.tree.map(jnp.negative, residual.constraints)
        dq, dlam = factors.solve(system, turned, forces, constraints)
        return jax.tree.map(lambda x: x / s, Unknowns(dq, dlam)), dq

    def tangent(
        self, system: System, end: Scalar, q0: Coordinates, v0: Coordinates, unknowns: Unknowns
    ) -> FrozenFactors:
        """The factors of the exact derivative of the residual."""
        q, v = self.end_of_step(system, end, q0, v0, unknowns.vdot)
        return self.factor(system, end, q, v, unknowns.lam)

    def transposable(self, system: System) -> System:
        """The system whose forces have a hand-written transpose."""
        return Transposable.of(system)

    def tolerances(self, system: System, q: Coordinates) -> Float[jax.Array, "2"]:
        """The largest remaining errors [m] of a converged step, of tether nodes and of the hub."""
        position = jnp.asarray(POSITION_TOLERANCE)
        if system.tethers.kind == "rod":
            lengths = system.tethers.element_length
            rods = jnp.maximum(ROD_TOLERANCE * lengths.min(), ROUNDING * lengths.sum())
            position = jnp.minimum(position, rods)
        return lax.stop_gradient(jnp.stack([position, jnp.asarray(HUB_TOLERANCE)]))

    def step(
        self, system: System, time: Scalar, state: StepState, factors: FrozenFactors, rate: Scalar
    ) -> tuple[StepState, IterationInfo]:
        """Takes a step from t to t + h, with iterations until the remaining error is within tolerance."""
        h = self.step_size
        end = time + h
        q0, v0, a0 = self.predict(state)
        guess = jax.tree.map(
            lambda *x: x[0] + x[1] + x[2], state.vdot, state.vdot_difference, state.vdot_second_difference
        )
        unknowns = Unknowns(system.place_roots(end, guess, derivative=2), state.lam)
        unknowns, power, info = solve_step(self, system, end, q0, v0, unknowns, factors, rate)
        vdot, lam = unknowns
        q, v = self.end_of_step(system, end, q0, v0, vdot)
        difference = jax.tree.map(jnp.subtract, vdot, state.vdot)
        work = jax.tree.map(
            lambda w, before, after: w + 0.5 * h * (before + after), state.work, state.power, power
        )
        state = StepState(
            q=q,
            v=v,
            vdot=vdot,
            a=a0.axpy(self._vdot_share, vdot),
            lam=lam,
            vdot_difference=difference,
            vdot_second_difference=jax.tree.map(jnp.subtract, difference, state.vdot_difference),
            work=work,
            power=power,
        )
        return state, info

    def after_trial(self, start: StepState, end: StepState) -> StepState:
        """The start with a_0 = vdot_0 + (alpha_m - alpha_f) h jerk. The jerk is chosen so that a
        step from there leads to the velocity at the end of the trial step.

        The trial step is implicit and damps stiff modes, which a time derivative of the accelerations would
        amplify."""
        c, h = self.parameters, self.step_size
        a_next = jax.tree.map(
            lambda v1, v0, a: ((v1 - v0) / h - (1.0 - c.gamma) * a) / c.gamma, end.v, start.v, start.a
        )
        vdot_next = jax.tree.map(
            lambda a1, a0, vdot: ((1.0 - c.alpha_m) * a1 + c.alpha_m * a0 - c.alpha_f * vdot)
            / (1.0 - c.alpha_f),
            a_next, start.a, start.vdot,
        )  # fmt: skip
        return self.with_difference(start, jax.tree.map(jnp.subtract, vdot_next, start.vdot))

    def with_difference(self, state: StepState, difference: Coordinates) -> StepState:
        """The state with a given first difference of vdot and a = vdot(t + (alpha_m - alpha_f)
        h)."""
        c = self.parameters
        a = state.vdot.axpy(c.alpha_m - c.alpha_f, difference)
        return state._replace(a=a, vdot_difference=difference)

    def rescaled(self, state: StepState, ratio: Scalar) -> StepState:
        """The state for steps of another length. The instant to which the auxiliary acceleration a
        belongs depends on the length of the step."""
        state = super().rescaled(state, ratio)
        return self.with_difference(state, state.vdot_difference)
