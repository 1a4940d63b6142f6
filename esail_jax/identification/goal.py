"""An objective of a design: how little the measurements of a run would tell of parameters.

    information        geometric mean of the principal relative variances, det(P F P)^(-1/n), P = diag |p_i|
    information:KEY    the variance of one parameter, (F^-1)_kk, in its unit squared

with the Fisher information F of the run and of priors (`information.py`). Both are made small.
"""

import dataclasses
from typing import Any

import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Scalar
from esail_jax.identification.information import Measured, fisher
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.scene import Scene

NAME = "information"
"""Name of the objective, before a colon and a parameter."""


@dataclasses.dataclass(frozen=True)
class Information:
    """The objective for the parameters `free`, measurements with the standard deviations `noise` at the
    saved instants, and priors. key: the parameter whose variance is made small; None for all together;
    max_steps: of a run, for its derivative (`model.steps_with_room`)."""

    free: tuple[str, ...]
    noise: tuple[tuple[str, float], ...]
    key: str | None = None
    priors: tuple[tuple[str, Any], ...] = ()
    max_steps: int | None = None

    @property
    def __name__(self) -> str:
        return NAME if self.key is None else f"{NAME}:{self.key}"

    def check(self, scene: Scene) -> None:
        """Raises SceneError for names and numbers that do not suit a scene."""
        names = self.measured(scene).names
        if self.key is not None and self.key not in names:
            raise SceneError(
                "objective", f"be of a free parameter ({', '.join(names)})", f"is {self.__name__}"
            )

    def measured(self, scene: Scene) -> Measured:
        """What is measured of a run of the scene."""
        return Measured.of(scene, self.free, dict(self.noise), None, dict(self.priors))

    def of_scene(self, scene: Scene) -> Scalar:
        """The objective of the run of a scene, whose numbers may be traced, but for those that are free."""
        measured = self.measured(scene)
        matrix = fisher(scene, measured, self.max_steps)
        if self.key is not None:
            unit = jnp.zeros(len(measured.names)).at[measured.names.index(self.key)].set(1.0)
            return unit @ jnp.linalg.solve(jnp.asarray(matrix), unit)
        values = np.array([parameter.start for parameter in measured.parameters])
        size = np.where(values == 0.0, 1.0, np.abs(values))
        return jnp.exp(-jnp.linalg.slogdet(matrix * np.outer(size, size))[1] / len(values))
