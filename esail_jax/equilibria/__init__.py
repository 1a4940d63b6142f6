"""Equilibria of a system and the vibration modes about them.

`equilibrium` finds the shape in which a system rotates steadily, or rests, under its loads (Newton's
method); `modes` returns the natural frequencies, damping ratios and shapes of small vibrations about that
state; `steady_line` solves for the stretch of straight spinning tethers, the steady start of a run.
"""

from esail_jax.equilibria.equilibrium import Equilibrium, equilibrium
from esail_jax.equilibria.modes import Matrices, Modes, linearised, modes
from esail_jax.equilibria.moving_frame import MovingFrame, expanded, independent
from esail_jax.equilibria.steady_stretch import along, steady_line, unstretched_line

__all__ = [
    "Equilibrium",
    "Matrices",
    "Modes",
    "MovingFrame",
    "along",
    "equilibrium",
    "expanded",
    "independent",
    "linearised",
    "modes",
    "steady_line",
    "unstretched_line",
]
