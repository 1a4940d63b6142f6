"""The length of the steps of collocation: error control, and the first step."""

import jax.numpy as jnp

from esail_jax.array_types import Scalar
from esail_jax.coordinates import Coordinates
from esail_jax.steppers.collocation_stages import STAGES, lengths
from esail_jax.steppers.collocation_steps import CollocationState, CollocationSteps
from esail_jax.system import System

SAFETY, SHRINK, GROW, DEADBAND = 0.85, 0.2, 3.0, 1.15
"""Step-size control: safety factor, smallest and largest change of the step size, and the gain below which
the step size is not changed."""


def change_of_step(error: Scalar) -> Scalar:
    """The factor to a step size whose error is the tolerance, with a safety factor. error: the
    estimated error over the tolerance, of order STAGES + 2 in the step size."""
    return jnp.clip(SAFETY * jnp.maximum(error, 1e-30) ** (-1 / (STAGES + 2)), SHRINK, GROW)


def next_step(state: CollocationState, records: CollocationSteps, h: Scalar) -> Scalar:
    """The step size [s] of the next block, from the largest error of a block with the step size h.
    A rejected step has chosen a smaller one already."""
    factor = change_of_step(jnp.where(records.taken, records.info.error, 0.0).max())
    factor = jnp.where((factor > 1.0 / DEADBAND) & (factor < DEADBAND), 1.0, factor)
    return jnp.where(state.h == h, h * factor, state.h)


def first_step(
    system: System, time: Scalar, q: Coordinates, vdot: Coordinates, tolerance: Scalar
) -> Scalar:
    """A guess of the first step size [s]: tolerance^(1/(STAGES + 2)) times the time in which the
    largest acceleration moves a node by the length of a tether."""
    fastest = jnp.abs(vdot.tether[0]).max()
    scale = jnp.sqrt(lengths(system, time, q)[0] / jnp.maximum(fastest, 1e-30))
    return tolerance ** (1.0 / (STAGES + 2)) * scale
