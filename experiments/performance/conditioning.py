"""Prints the condition number of the iteration matrix of generalized-alpha for several steps.

    python experiments/performance/conditioning.py

The matrix belongs to the baseline at its start. Its multipliers are scaled by the step
(`iteration_matrix.tangent`), its rows and columns until the largest entry of each is 1.
"""

import jax
import jax.numpy as jnp
import numpy as np

import esail_jax as esail
from esail_jax import iteration_matrix
from esail_jax.numerics import bordered
from esail_jax.scenes.build import build
from esail_jax.scenes.structure import split
from esail_jax.steppers.consistent import consistent_acceleration
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha

STEPS = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0)


def dense(matrix: bordered.Bordered) -> np.ndarray:
    """The dense matrix that `bordered.solve` inverts, from the solutions for unit vectors."""
    factors = bordered.factor(matrix)
    links, rows, tethers = matrix.upper.shape[0], matrix.diag.shape[1], matrix.diag.shape[-1]
    free = matrix.free * tethers
    border = matrix.border.shape[0]
    size = free + links * rows * tethers + border

    def solve(x):
        port = jnp.zeros((rows, tethers)).at[matrix.held :].set(x[:free].reshape(-1, tethers))
        blocks = x[free : size - border].reshape(links, rows, tethers)
        rhs = bordered.Vector(jnp.concatenate([port[None], blocks]), None, x[size - border :])
        out = bordered.solve(matrix, factors, rhs)
        parts = (out.blocks[0, matrix.held :], out.blocks[1:], out.border)
        return jnp.concatenate([part.reshape(-1) for part in parts])

    return np.linalg.inv(np.asarray(jax.vmap(solve)(jnp.eye(size)).T))


def condition(matrix: np.ndarray) -> float:
    """The condition number of the matrix after equilibration (Ruiz)."""
    for _ in range(20):
        rows, columns = (1.0 / np.sqrt(np.abs(matrix).max(axis)) for axis in (1, 0))
        matrix = rows[:, None] * matrix * columns
    return float(np.linalg.cond(matrix))


def main() -> None:
    """Prints one line per step."""
    model = build(*split(esail.load_scene("baseline")))
    zero = jnp.zeros(())
    _, lam = consistent_acceleration(model.system, zero, model.q, model.v)
    for h in STEPS:
        stepper = GeneralizedAlpha(jnp.asarray(h), jnp.asarray(0.25))
        c = stepper.parameters
        made = iteration_matrix.tangent(
            model.system, zero, model.q, model.v, lam, stepper._q_share, c.gamma / (h * c.beta)
        )
        print(f"h = {h:7.0e} s   condition number {condition(dense(made)):.3g}", flush=True)


if __name__ == "__main__":
    main()
