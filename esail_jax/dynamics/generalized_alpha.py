"""Generalized-alpha for the index-3 equations (Arnold & Brüls 2007; [PGV] Eq. 12-15).

    M vdot_{n+1} + Phi_q^T lam_{n+1} = Q(t, q, v)_{n+1},      Phi(q_{n+1}) = 0
    (1 - alpha_m) a_{n+1} + alpha_m a_n = (1 - alpha_f) vdot_{n+1} + alpha_f vdot_n
    q_{n+1} = q_n + h v_n + h^2 ((1/2 - beta) a_n + beta a_{n+1})
    v_{n+1} = v_n + h ((1 - gamma) a_n + gamma a_{n+1})

The unknowns are vdot_{n+1} and lam_{n+1}, found by chord iterations. Two things make one iteration
per step enough on a smooth motion: vdot is extrapolated quadratically for the first guess, and the
factors, kept over `KEEP` steps, are turned with the hub. Inertia, elasticity, damping and rigidity
look the same from every direction, so factors made at one attitude serve at any other: what they
lose is only the change of shape, not the rotation.

The derivative of a step is that of the equations at their solution (implicit function theorem) with
a fresh tangent, whatever the iterations did; a forward run does not pay for it.
"""

from abc import abstractmethod
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax import newton_matrix
from esail_jax.array_types import Float, Int, Rotation, Scalar
from esail_jax.coordinates import Coordinates, Multipliers
from esail_jax.numerics import bordered
from esail_jax.system import Power, Residual, System

KEEP = 20
"""Steps per factorisation. A block of this many steps is the unit of work everywhere: a resumed run
starts at a block, so that it factors where the uninterrupted one did."""

MAX_ITERATIONS = 12
"""Chord iterations after which a step has failed; good ones take one to three."""

POSITION_TOLERANCE = 1e-8
"""[m] largest last increment of a nodal position (or of l r_x)."""

HUB_TOLERANCE = 1e-10
"""[m] the same for the hub's base points: 1e-8 m would be an attitude error of 1e-8 rad."""

ROD_TOLERANCE, ROUNDING = 1e-11, 1e-14
"""For rods, which may be short: part of the shortest one's length, but not below this part of the
chain's, which positions are rounded to. 1e-8 m of a steel rod of 0.1 m would be a twentieth of its
stretch under its own weight."""


class Parameters(NamedTuple):
    """Coefficients of the method for one spectral radius rho_inf at infinite frequency."""

    alpha_m: Scalar
    alpha_f: Scalar
    beta: Scalar
    gamma: Scalar

    @classmethod
    def from_spectral_radius(cls, rho: Scalar) -> "Parameters":
        """[PGV] after Eq. 15 (there mu is gamma and nu is beta)."""
        alpha_m = (2.0 * rho - 1.0) / (rho + 1.0)
        alpha_f = rho / (rho + 1.0)
        gamma = 0.5 + alpha_f - alpha_m
        return cls(alpha_m, alpha_f, 0.25 * (gamma + 0.5) ** 2, gamma)


class State(NamedTuple):
    """What one step hands to the next.

    rise, bend: first and second differences of vdot over the last steps, for the first guess.
    work: external work and dissipated energy [J] since the start of the run; power: their rates
    [W] at this instant.
    """

    q: Coordinates
    v: Coordinates
    vdot: Coordinates
    a: Coordinates
    lam: Multipliers
    rise: Coordinates
    bend: Coordinates
    work: Power
    power: Power


class KeptFactors(NamedTuple):
    """Factors of an iteration matrix, and the attitude they were made at."""

    matrix: bordered.Bordered
    factors: bordered.Factors
    rotation: Rotation

    def solve(
        self, system: System, turned: Rotation, forces: Coordinates, constraints: Multipliers
    ) -> tuple[Coordinates, Multipliers]:
        """(dq, s dlam) for a right-hand side given at an attitude `turned` from the factors'."""
        rhs = newton_matrix.to_vector(system, forces.rotate(turned.T), constraints)
        dq, dlam = newton_matrix.from_vector(system, bordered.solve(self.matrix, self.factors, rhs))
        return dq.rotate(turned), dlam


class StepInfo(NamedTuple):
    """How a step went.

    iterations; increment [m]: the last one, of tether nodes and of the hub, and the tolerances [m]
    they are held to; constraint [m] and
    residual [N]: largest constraint violation and unbalanced force of a node beyond the root, before
    the last correction and any scaling; tether: the one with the largest increment.
    """

    iterations: Int[jax.Array, ""]
    increment: Float[jax.Array, "2"]
    tolerance: Float[jax.Array, "2"]
    constraint: Scalar
    residual: Scalar
    tether: Int[jax.Array, ""]

    def converged(self) -> jax.Array:
        """False also for NaN."""
        return (self.increment <= self.tolerance).all()


class Unknowns(NamedTuple):
    """What a step solves for."""

    vdot: Coordinates
    lam: Multipliers


class FixedStep(eqx.Module):
    """A method that finds vdot and lam of a step by chord iterations: numbers are leaves, so that a new
    step size does not compile again. The rest of what `solve_step` asks of one is in its subclasses:
    `attitude`, `residual`, `correct`, `tangent` and `tolerances`."""

    step_size: Scalar

    most_iterations: ClassVar[int] = MAX_ITERATIONS

    @abstractmethod
    def factor(
        self, system: System, time: Scalar, q: Coordinates, v: Coordinates, lam: Multipliers
    ) -> KeptFactors:
        """Iteration matrix at a state, and its factors."""

    @abstractmethod
    def step(self, system: System, time: Scalar, state: State, kept: KeptFactors) -> tuple[State, StepInfo]:
        """From t to t + h, until the last chord increment is within tolerance."""

    def block(
        self, system: System, time: Scalar, state: State, steps: int
    ) -> tuple[State, tuple[State, StepInfo]]:
        """`steps` steps with one factorisation; also every state after a step."""
        kept = self.factor(system, time, state.q, state.v, state.lam)

        def advance(carry, index):
            state, info = self.step(system, time + index * self.step_size, carry, kept)
            return state, (state, info)

        return lax.scan(advance, state, jnp.arange(steps))


class GeneralizedAlpha(FixedStep):
    """The stepper."""

    spectral_radius: Scalar

    @property
    def parameters(self) -> Parameters:
        return Parameters.from_spectral_radius(self.spectral_radius)

    @property
    def _vdot_share(self) -> Scalar:
        """d a_{n+1} / d vdot_{n+1}."""
        c = self.parameters
        return (1.0 - c.alpha_f) / (1.0 - c.alpha_m)

    @property
    def _q_share(self) -> Scalar:
        """s = d q_{n+1} / d vdot_{n+1} [s^2]; the iteration matrix is M + s K + ... ."""
        return self.step_size**2 * self.parameters.beta * self._vdot_share

    def factor(
        self, system: System, time: Scalar, q: Coordinates, v: Coordinates, lam: Multipliers
    ) -> KeptFactors:
        """Iteration matrix ([PGV] Eq. 13, scaled by s) at a state, and its factors."""
        c = self.parameters
        rate_factor = c.gamma / (self.step_size * c.beta)
        matrix = newton_matrix.tangent(system, time, q, v, lam, self._q_share, rate_factor)
        return KeptFactors(matrix, bordered.factor(matrix), system.rotation(time, q))

    def predict(self, state: State) -> tuple[Coordinates, Coordinates, Coordinates]:
        """q, v and a at the end of the step without the share of vdot_{n+1}."""
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

        Roots are put where they belong: no equation compares them with the hub, and what rounding
        parts would drift away with the fourth power of time.
        """
        v_share = self.step_size * self.parameters.gamma * self._vdot_share
        q, v = q0.axpy(self._q_share, vdot), v0.axpy(v_share, vdot)
        return system.place_roots(end, q), system.place_roots(end, v, derivative=1)

    def attitude(
        self, system: System, end: Scalar, q0: Coordinates, v0: Coordinates, vdot: Coordinates
    ) -> Rotation:
        """Where the factors are turned to, near the step's end."""
        q, _ = self.end_of_step(system, end, q0, v0, vdot)
        return system.rotation(end, q)

    def residual(
        self, system: System, end: Scalar, q0: Coordinates, v0: Coordinates, unknowns: Unknowns
    ) -> tuple[Residual, Power]:
        """Residual of the equations at the end of the step, and the power of its forces."""
        q, v = self.end_of_step(system, end, q0, v0, unknowns.vdot)
        return system.residual(end, q, v, unknowns.vdot, unknowns.lam)

    def correct(
        self, system: System, residual: Residual, kept: KeptFactors, turned: Rotation
    ) -> tuple[Unknowns, Coordinates]:
        """Change of the unknowns that a chord step asks for, and the change of q that goes with it."""
        s = self._q_share
        forces = jax.tree.map(lambda r: -s * r, residual.forces)
        constraints = jax.tree.map(jnp.negative, residual.constraints)
        dq, dlam = kept.solve(system, turned, forces, constraints)
        return jax.tree.map(lambda x: x / s, Unknowns(dq, dlam)), dq

    def tangent(
        self, system: System, end: Scalar, q0: Coordinates, v0: Coordinates, unknowns: Unknowns
    ) -> KeptFactors:
        """Factors of the exact derivative of the residual."""
        q, v = self.end_of_step(system, end, q0, v0, unknowns.vdot)
        return self.factor(system, end, q, v, unknowns.lam)

    def tolerances(self, system: System, q: Coordinates) -> Float[jax.Array, "2"]:
        """Largest last increments [m] of a step that has converged, of tether nodes and of the hub."""
        position = jnp.asarray(POSITION_TOLERANCE)
        if system.tethers.kind == "rod":
            lengths = system.tethers.element_length
            rods = jnp.maximum(ROD_TOLERANCE * lengths.min(), ROUNDING * lengths.sum())
            position = jnp.minimum(position, rods)
        return lax.stop_gradient(jnp.stack([position, jnp.asarray(HUB_TOLERANCE)]))

    def step(self, system: System, time: Scalar, state: State, kept: KeptFactors) -> tuple[State, StepInfo]:
        """From t to t + h, until the last chord increment is within tolerance."""
        h = self.step_size
        end = time + h
        q0, v0, a0 = self.predict(state)
        guess = jax.tree.map(lambda *x: x[0] + x[1] + x[2], state.vdot, state.rise, state.bend)
        unknowns = Unknowns(system.place_roots(end, guess, derivative=2), state.lam)
        unknowns, power, info = solve_step(self, system, end, q0, v0, unknowns, kept)
        vdot, lam = unknowns
        q, v = self.end_of_step(system, end, q0, v0, vdot)
        rise = jax.tree.map(jnp.subtract, vdot, state.vdot)
        work = jax.tree.map(
            lambda w, before, after: w + 0.5 * h * (before + after), state.work, state.power, power
        )
        state = State(
            q=q,
            v=v,
            vdot=vdot,
            a=a0.axpy(self._vdot_share, vdot),
            lam=lam,
            rise=rise,
            bend=jax.tree.map(jnp.subtract, rise, state.rise),
            work=work,
            power=power,
        )
        return state, info


@jax.custom_jvp
def solve_step(
    stepper: FixedStep,
    system: System,
    end: Scalar,
    q0: Coordinates,
    v0: Coordinates,
    guess: Unknowns,
    kept: KeptFactors,
) -> tuple[Unknowns, Power, StepInfo]:
    """Chord iterations. Guess and factors decide how fast they converge, not where to: they carry
    no derivative."""
    turned = stepper.attitude(system, end, q0, v0, guess.vdot) @ kept.rotation.T

    def iterate(carry):
        unknowns, _, info = carry
        residual, power = stepper.residual(system, end, q0, v0, unknowns)
        change, dq = stepper.correct(system, residual, kept, turned)
        unknowns = jax.tree.map(jnp.add, unknowns, change)
        norms, worst = increment_norms(system, dq)
        info = StepInfo(
            iterations=info.iterations + 1,
            increment=norms,
            tolerance=info.tolerance,
            constraint=largest(residual.constraints),
            residual=jnp.abs(residual.forces.tether[0, :, 1:]).max(),
            tether=worst,
        )
        return unknowns, power, info

    def unfinished(carry):
        info = carry[-1]
        return ~info.converged() & (info.iterations < stepper.most_iterations)

    zero, none = jnp.zeros(()), jnp.zeros((), int)
    start = StepInfo(none, jnp.full(2, jnp.inf), stepper.tolerances(system, q0), zero, zero, none)
    return lax.while_loop(unfinished, iterate, (guess, Power(zero, zero), start))


@solve_step.defjvp
def _solve_step_jvp(primals, tangents):
    """d(unknowns) = -(dR/dx)^{-1} dR: implicit function theorem with the exact tangent."""
    stepper, system, end, q0, v0, *_ = primals
    given, given_dot = primals[:5], tangents[:5]
    unknowns, power, info = solve_step(*primals)
    equations = type(stepper).residual
    _, (residual_dot, _) = jax.jvp(lambda *x: equations(*x, unknowns), given, given_dot)
    fresh = lax.stop_gradient(stepper.tangent(system, end, q0, v0, unknowns))
    unknowns_dot, _ = stepper.correct(system, residual_dot, fresh, jnp.eye(3))
    _, (_, power_dot) = jax.jvp(equations, (*given, unknowns), (*given_dot, unknowns_dot))
    none = np.zeros((), jax.dtypes.float0)
    info_dot = StepInfo(none, jnp.zeros(2), jnp.zeros(2), jnp.zeros(()), jnp.zeros(()), none)
    return (unknowns, power, info), (unknowns_dot, power_dot, info_dot)


def increment_norms(system: System, dq: Coordinates) -> tuple[Float[jax.Array, "2"], Int[jax.Array, ""]]:
    """Largest change [m] of a tether's nodal coordinates (slopes times l) and of the hub's, and
    which tether's it is."""
    tether = jnp.abs(system.tethers.scale_slopes(dq.tether)).max((0, 1, 2))
    hub = jnp.abs(dq.hub).max() if dq.hub is not None else jnp.zeros(())
    return jnp.stack([tether.max(), hub]), jnp.argmax(tether)


def largest(constraints: Multipliers) -> Scalar:
    """Largest constraint violation [m]."""
    leaves = jax.tree.leaves(constraints)
    return jnp.stack([jnp.abs(x).max() for x in leaves]).max() if leaves else jnp.zeros(())
