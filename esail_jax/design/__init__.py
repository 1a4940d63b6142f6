"""Gradient-based design of voltages and of any other number of a scene."""

from esail_jax.design.problem import Design, Variable

__all__ = ["Design", "Variable"]
