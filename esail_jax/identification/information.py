"""The Fisher information of a run, before anything is measured."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Float
from esail_jax.errors import SimulationError
from esail_jax.files.selection import Column
from esail_jax.identification.model import Cells, jacobian_of, measurable, predictor
from esail_jax.identification.parameters import Parameter, check_starts, parameters_of
from esail_jax.identification.priors import Prior, priors_of
from esail_jax.identification.telemetry import HEADER, NOISE, Telemetry, deviations_of, placed
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.scene import Scene
from esail_jax.simulation.schedule import save_times
from esail_jax.simulation.under_trace import under_trace
from esail_jax.steppers.results import RESULTS


class Measured(NamedTuple):
    """What would be measured of a run: the cells, without values; the parameters that are asked for; and
    what is known of them before, by their index."""

    cells: Cells
    parameters: tuple[Parameter, ...]
    priors: Mapping[int, Prior]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    @classmethod
    def of(
        cls,
        scene: Scene,
        free: Sequence[str],
        noise: Mapping[str, float],
        times: Sequence[float] | np.ndarray | None,
        priors: Mapping[str, Any] | None = None,
    ) -> "Measured":
        """Checks everything. Raises SceneError."""
        cells, parameters = planned(scene, free, noise, times)
        names = [parameter.name for parameter in parameters]
        return cls(cells, tuple(parameters), priors_of(priors, names))


def information(
    scene: Scene | str,
    free: Sequence[str],
    noise: Mapping[str, float],
    times: Sequence[float] | np.ndarray | None = None,
    *,
    priors: Mapping[str, Any] | None = None,
) -> tuple[tuple[str, ...], Float[Array | np.ndarray, "parameter parameter"]]:
    """The Fisher information that measurements of a run would have on parameters: their names, and

        F = sum over all cells of (dh/dp)^T (dh/dp) / s^2,

    in units of one over the product of those of two parameters. Its inverse is the least covariance of an
    unbiased estimate (Cramer and Rao).

    scene: a scene, a name or a path; free: names of parameters, as for `fit`; noise: standard deviations by
    observable, for all of its places, or by place (`"coning_angle[1]"`): what has none is not measured;
    times: instants of the measurements [s], None for the saved instants of the run; priors: as for `fit`,
    each of which adds 1/sd^2 on the diagonal.

        names, matrix = information("baseline", ["solar_wind.number_density"], {"spin_rate[2]": 1e-7})

    Numbers of the scene other than those that are free may be traced: the matrix then has derivatives by
    them. Raises SceneError, and SimulationError if the run or its derivative fails."""
    scene = load_scene(scene)
    measured = Measured.of(scene, free, noise, times, priors)
    return measured.names, fisher(scene, measured)


def fisher(
    scene: Scene, measured: Measured, max_steps: int | None = None
) -> Float[Array | np.ndarray, "parameter parameter"]:
    """The information of a run of a scene whose numbers may be traced, but for those that are free.
    max_steps: of a run that is traced, for which the run of the scene cannot tell it."""
    cells, parameters = measured.cells, measured.parameters
    values = np.array([parameter.start for parameter in parameters])
    if not under_trace(scene, None, None):
        jacobian = predictor(scene, parameters, cells)(values).jacobian
        if not np.isfinite(jacobian).all():
            raise SimulationError("The run with its derivatives fails: see `esail run`", RESULTS.nonfinite)
        return np.asarray(matrix_of(jnp.asarray(jacobian), measured))
    _, traced = jacobian_of(scene, parameters, cells, max_steps)(jnp.asarray(values))
    return matrix_of(traced, measured)


def matrix_of(
    jacobian: Float[Array, "cell parameter"], measured: Measured
) -> Float[Array, "parameter parameter"]:
    """The information of measurements with these derivatives, and of the priors."""
    rows = jacobian / measured.cells.deviations[:, None]
    known = np.zeros(len(measured.parameters))
    for k, prior in measured.priors.items():
        known[k] = prior.sd**-2
    return rows.T @ rows + jnp.diag(known)


def planned(
    scene: Scene,
    free: Sequence[str],
    noise: Mapping[str, float],
    times: Sequence[float] | np.ndarray | None,
) -> tuple[Cells, list[Parameter]]:
    """The cells that would be measured, and the parameters. Raises SceneError."""
    shapes = measurable(scene)
    columns: list[Column] = []
    for text in noise:
        parts = HEADER.fullmatch(text.strip())
        if parts is None or parts["name"] not in shapes:
            raise SceneError(NOISE, "be given by observable of the run, such as spin_rate", f"has {text!r}")
        shape, place = shapes[parts["name"]], placed(parts["place"])
        places = [tuple(i + 1 for i in at) for at in np.ndindex(shape)]
        if place is not None and place not in places:
            sizes = " x ".join(map(str, shape)) or "no"
            raise SceneError(NOISE, f"name one of the {sizes} places of {parts['name']}", f"has {text!r}")
        columns += [Column(parts["name"], at) for at in places if place in (None, at)]
    columns = list(dict.fromkeys(columns))
    if not columns:
        raise SceneError(NOISE, "have an observable that is measured", "is empty")
    if times is None:
        at = save_times(float(scene.integrator.t_end), scene.output.interval)
    else:
        at = np.asarray(times, float)
    end = float(scene.integrator.t_end)
    if at.ndim != 1 or not len(at) or not ((at >= 0.0) & (at <= end)).all():
        raise SceneError("times", f"be instants within the run, 0 to {end:g} s", f"is {times!r}")
    measured = {column.name: shapes[column.name] for column in columns}
    parameters = parameters_of(scene, free, measured)
    check_starts(parameters)
    table = Telemetry(NOISE, at, tuple(columns), np.zeros((len(at), len(columns))))
    return Cells.of(table, deviations_of(noise, [table])[0]), parameters
