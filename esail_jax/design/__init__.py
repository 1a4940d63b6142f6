"""Gradient-based design of voltages and of any other number of a scene.

    from esail_jax.design import Design, Objective, Variable
    design = Design(scene, {"mean-torque": 1.0, "thrust": 1.0}, {"voltage.cosine": Variable([0.0], 0.1)})
    *_, last = design.optimise(10)
    best = design.scene_at(last.x[last.best])

`Objective(scene, weights)` alone is a differentiable function of `{"voltage.cosine": ...}`, for any
optimiser.
"""

from esail_jax.design.objective import Objective
from esail_jax.design.objectives import OBJECTIVES, plane_normals, spin_axes
from esail_jax.design.optimiser import Optimiser, State
from esail_jax.design.problem import Design, Variable

__all__ = [
    "OBJECTIVES",
    "Design",
    "Objective",
    "Optimiser",
    "State",
    "Variable",
    "plane_normals",
    "spin_axes",
]
