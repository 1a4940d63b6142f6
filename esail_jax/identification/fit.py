"""Fitting numbers of a scene to the telemetry of its run.

    minimise  sum_k rho(r_k(p)^2),    r = (h(p) - y) / s,    and for every prior (p_i - m_i) / s_i

over parameters p within the bounds of the scene's rules, with `scipy.optimize.least_squares` and the
derivative of the whole run.
"""

import dataclasses
import functools
import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import jax.numpy as jnp
import numpy as np
from scipy import optimize, stats

from esail_jax.array_types import Float
from esail_jax.errors import SimulationError
from esail_jax.identification.model import Cells, Prediction, measurable, predictor
from esail_jax.identification.parameters import Parameter, check_starts, overrides_of, parameters_of
from esail_jax.identification.priors import Prior, priors_of
from esail_jax.identification.telemetry import Telemetry, deviations_of, telemetry_of
from esail_jax.identification.uncertainty import Uncertainty, Weakest, uncertainty_of
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.rules import SceneError
from esail_jax.scenes.scene import Scene
from esail_jax.steppers.results import RESULTS

Loss = Literal["linear", "soft_l1", "huber", "cauchy"]

TOLERANCE = 1e-10
"""Relative change of the cost and of the parameters at which the fit ends: derivatives of a run are right
to about 1e-9."""

BENT = 0.3
"""Part of 1 by which chi squared, one standard deviation away along an axis of the error ellipsoid, may
differ from its least value plus 1 before the fit says that the errors are not those of a normal
distribution."""

UNLIKELY = 1e-3
"""Probability of a chi squared so large below which the fit says that model, noise or both are wrong."""


@dataclasses.dataclass(frozen=True)
class Fit:
    """The result of a fit.

    parameters: their names; values, sd: estimates and standard deviations, in `units`; covariance,
    correlation: (parameter, parameter); chi_squared: sum of the squared residuals of data and priors;
    degrees_of_freedom: residuals less parameters; probability: of a chi squared at least as large;
    weakest: the combination that is known least; warnings: what is to be said of the result, in sentences;
    scene: with the estimates; residuals: of every run, like its data (row, column), in units of the noise,
    NaN where nothing was measured; data: of every run; evaluations: of the run with its derivatives."""

    parameters: tuple[str, ...]
    values: Float[np.ndarray, " parameter"]
    sd: Float[np.ndarray, " parameter"]
    units: tuple[str, ...]
    covariance: Float[np.ndarray, "parameter parameter"]
    correlation: Float[np.ndarray, "parameter parameter"]
    chi_squared: float
    degrees_of_freedom: int
    probability: float
    weakest: Weakest
    warnings: tuple[str, ...]
    scene: Scene
    residuals: tuple[Float[np.ndarray, "_ _"], ...]
    data: tuple[Telemetry, ...]
    evaluations: int
    problem: "Problem" = dataclasses.field(repr=False)

    def __getitem__(self, name: str) -> float:
        """The estimate of a parameter."""
        return float(self.values[self.parameters.index(name)])

    def profile(self, name: str) -> tuple[float, float]:
        """The interval of a parameter in which chi squared, least over all others, is larger than its least
        value by 1 at most: that of 68 % by the likelihood, also where errors are not those of a normal
        distribution. An end is infinite if chi squared does not grow so far within ten standard deviations,
        and a bound if it is reached first. Raises SceneError for another name, for a parameter that is not
        seen, and for a loss other than the linear one, under which chi squared is not what is least."""
        if name not in self.parameters:
            raise SceneError(
                "name", f"be a parameter of the fit ({', '.join(self.parameters)})", f"is {name!r}"
            )
        if self.problem.loss != "linear":
            raise SceneError("loss", "be linear for a profile", f"is {self.problem.loss}")
        k = self.parameters.index(name)
        if not np.isfinite(self.sd[k]):
            raise SceneError("name", "be a parameter that the data see", f"is {name}, which they do not")
        along = Profile(self, k)
        return along.end(-1.0), along.end(1.0)

    def __repr__(self) -> str:
        rows = [
            f"  {name:<40} {value:.6g} +- {sd:.2g} {unit}"
            for name, value, sd, unit in zip(self.parameters, self.values, self.sd, self.units, strict=True)
        ]
        head = (
            f"Fit: chi squared {self.chi_squared:.5g} with {self.degrees_of_freedom} degrees of freedom "
            f"(probability {self.probability:.2g})"
        )
        return "\n".join([head, *rows, f"  weakest: {self.weakest.words}", *map(str, self.warnings)])


class Best(NamedTuple):
    """The best point so far. cost: half of the sum of squares, or of their losses."""

    values: Float[np.ndarray, " parameter"]
    cost: float
    evaluations: int


Told = Callable[[Best], object]
"""A function that is called with every better point."""


def fit(
    scene: Scene | str | os.PathLike,
    data: Any,
    free: Sequence[str],
    noise: Mapping[str, float],
    priors: Mapping[str, Any] | None = None,
    *,
    loss: Loss = "linear",
    start: Sequence[float] | np.ndarray | None = None,
    evaluations: int = 50,
    told: Told | None = None,
) -> Fit:
    """Fits numbers of a scene to measurements of its run, and says how well they are known.

    scene: a scene, a name or a path; data: a CSV file with columns of `esail export`, a DataFrame, or a
    mapping of observables to arrays (row, ...) with `time`; a list of these for several runs of the scene.
    Missing values are NaN. free: parameters: scene keys (`solar_wind.number_density`, `tethers.length[*]`,
    `hub.inertia[1,2]`), biases and misalignments of instruments (`bias.spin_rate[1]`,
    `misalignment.angular_velocity_B[*]`); noise: standard deviations by observable, or by place of one
    (`coning_angle[2]`); priors: by name of a parameter, `Prior(mean, sd)` or "normal:MEAN:SD"; loss:
    "linear" for normal noise, or one of `scipy.optimize.least_squares` that gives outliers less weight;
    start: values at first, None for those of the scene; evaluations: most runs with derivatives; told: is
    called with every better point.

        result = fit("sail.toml", "telemetry.csv", ["solar_wind.thrust_factor"], {"spin_rate": 1e-6})
        result["solar_wind.thrust_factor"], result.sd

    Raises SceneError for data, names or numbers that are wrong, before anything is compiled, and
    SimulationError if the run at the start fails."""
    problem = Problem.of(load_scene(scene), data, free, noise, priors, loss)
    return problem.solved(start, evaluations, told)


@dataclasses.dataclass(frozen=True)
class Problem:
    """What is to be fitted: a scene with its data, parameters, and priors by the index of a parameter."""

    scene: Scene
    data: tuple[Telemetry, ...]
    cells: tuple[Cells, ...]
    parameters: tuple[Parameter, ...]
    priors: Mapping[int, Prior]
    loss: Loss

    @classmethod
    def of(
        cls,
        scene: Scene,
        data: Any,
        free: Sequence[str],
        noise: Mapping[str, float],
        priors: Mapping[str, Any] | None = None,
        loss: Loss = "linear",
    ) -> "Problem":
        """Checks everything. Raises SceneError."""
        shapes = measurable(scene)
        sources = list(data) if isinstance(data, list | tuple) else [data]
        if not sources:
            raise SceneError("data", "be that of one run or more", "is empty")
        labels = [f"data[{k}]" if len(sources) > 1 else "data" for k in range(len(sources))]
        tables = tuple(telemetry_of(one, scene, shapes, x) for one, x in zip(sources, labels, strict=True))
        deviations = deviations_of(noise, tables)
        cells = tuple(Cells.of(*pair) for pair in zip(tables, deviations, strict=True))
        measured = {name: shapes[name] for table in tables for name in table.names}
        parameters = tuple(parameters_of(scene, free, measured))
        check_starts(parameters)
        if loss not in LOSSES:
            raise SceneError("loss", "be linear, soft_l1, huber or cauchy", f"is {loss!r}")
        known = priors_of(priors, [parameter.name for parameter in parameters])
        return cls(scene, tables, cells, parameters, known, loss)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    def noise_of(self, data: Telemetry) -> Float[np.ndarray, " column"]:
        """The standard deviations of the columns of one of the runs, NaN of those without measurements."""
        cells = self.cells[[one is data for one in self.data].index(True)]
        columns = np.nonzero(np.isfinite(data.values))[1]
        deviations = np.full(len(data.columns), np.nan)
        deviations[columns] = cells.deviations
        return deviations

    @functools.cached_property
    def models(self) -> list[Callable[[np.ndarray], Prediction]]:
        """What the runs predict; each is compiled when it is first called."""
        return [predictor(self.scene, self.parameters, cells) for cells in self.cells]

    def with_values(self, values: Sequence[Float[np.ndarray, " cell"]]) -> "Problem":
        """The problem with other measurements in the cells of every run, with the same programs."""
        cells = tuple(one._replace(values=x) for one, x in zip(self.cells, values, strict=True))
        other = dataclasses.replace(self, cells=cells)
        other.__dict__["models"] = self.models
        return other

    def solved(
        self,
        start: Sequence[float] | np.ndarray | None = None,
        evaluations: int = 50,
        told: Told | None = None,
    ) -> Fit:
        """The fit. Raises SceneError for a start or a number of evaluations that is wrong, and
        SimulationError if the run at the start fails."""
        if evaluations < 1:
            raise SceneError("evaluations", "be positive", f"is {evaluations}")
        first = np.array([p.start for p in self.parameters] if start is None else start, float)
        low, high = (np.array([getattr(p, end) for p in self.parameters]) for end in ("low", "high"))
        if first.shape != low.shape or not ((low <= first) & (first <= high)).all():
            raise SceneError("start", "have a value within its bounds for every parameter", f"is {start!r}")
        model = Residuals(self, told)
        if not np.isfinite(model.at(first)).all():
            raise SimulationError(
                "The run at the start of the fit fails: see `esail run`", RESULTS.nonfinite
            )
        model.tell(first)
        found = optimize.least_squares(
            model.at, np.clip(first, low, high), model.jacobian, bounds=(low, high), x_scale="jac",
            loss=self.loss, ftol=TOLERANCE, xtol=TOLERANCE, gtol=None, max_nfev=evaluations,
            callback=lambda intermediate_result: model.tell(intermediate_result.x),
        )  # fmt: skip
        warnings = [] if found.status > 0 else [f"The fit has not ended after {evaluations} evaluations."]
        return self.result(found.x, model, warnings)

    def result(self, values: np.ndarray, model: "Residuals", warnings: list[str]) -> Fit:
        """The fit at its end."""
        residuals, jacobian = model.at(values), model.jacobian(values)
        weights = np.sqrt(SLOPES[self.loss](residuals**2))
        about = uncertainty_of(self.names, values, weights[:, None] * jacobian)
        if self.loss != "linear":
            warnings.append(f"Error bars count measurements by their weights under the loss {self.loss}.")
        count = len(residuals) - len(values)
        chi_squared = float(residuals @ residuals)
        probability = float(stats.chi2.sf(chi_squared, count)) if count > 0 else float("nan")
        if probability < UNLIKELY:
            warnings.append(
                f"Chi squared is {chi_squared:.4g} with {count} degrees of freedom: a model that is right, "
                f"with noise as given, has one so large with a probability of {probability:.1g}."
            )
        if count <= 0:
            warnings.append("There are no more measurements than parameters: nothing tests the model.")
        warnings += self.at_bounds(values)
        if not np.isfinite(about.sd).all():
            warnings.append(f"Not seen: {about.weakest.words}.")
        elif self.loss == "linear":
            warnings += bent(values, about, model)
        fitted = overrides_of(self.scene, self.parameters)(jnp.asarray(values))
        plain = {key: np.asarray(x).tolist() for key, x in fitted.items()}
        return Fit(
            self.names, values, about.sd, tuple(p.unit for p in self.parameters), about.covariance,
            about.correlation, chi_squared, count, probability, about.weakest, tuple(warnings),
            self.scene.replace(plain), self.residuals_like_data(residuals), self.data,
            model.evaluations, self,
        )  # fmt: skip

    def at_bounds(self, values: np.ndarray) -> list[str]:
        """Sentences on parameters that have ended at a bound."""
        said = []
        for parameter, value in zip(self.parameters, values, strict=True):
            for bound in (parameter.low, parameter.high):
                if np.isfinite(bound) and abs(value - bound) <= 1e-9 * max(
                    abs(parameter.start), abs(bound)
                ):
                    said.append(
                        f"{parameter.name} is at its bound {bound:g}: its error bar has no meaning."
                    )
        return said

    def residuals_like_data(self, residuals: np.ndarray) -> tuple[np.ndarray, ...]:
        """The residuals of every run in the form of its data."""
        tables, first = [], 0
        for data, cells in zip(self.data, self.cells, strict=True):
            table = np.full(data.values.shape, np.nan)
            table[np.isfinite(data.values)] = residuals[first : first + len(cells.values)]
            first += len(cells.values)
            tables.append(table)
        return tuple(tables)


class Residuals:
    """The residuals of data and priors, in units of their deviations, with their derivative."""

    def __init__(self, problem: Problem, told: Told | None):
        self.problem, self.told = problem, told
        self.evaluations, self.best = 0, np.inf
        self._at: np.ndarray | None = None
        self._found: tuple[np.ndarray, np.ndarray] | None = None

    def of(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residuals and their derivative, kept until they are asked for at another point."""
        if self._found is not None and self._at is not None and np.array_equal(self._at, values):
            return self._found
        residuals, rows = [], []
        for model, cells in zip(self.problem.models, self.problem.cells, strict=True):
            prediction: Prediction = model(values)
            residuals.append((prediction.values - cells.values) / cells.deviations)
            rows.append(prediction.jacobian / cells.deviations[:, None])
        for k, prior in self.problem.priors.items():
            residuals.append(np.array([(values[k] - prior.mean) / prior.sd]))
            rows.append(np.eye(len(values))[k : k + 1] / prior.sd)
        self.evaluations += 1
        self._at, self._found = values.copy(), (np.concatenate(residuals), np.concatenate(rows))
        return self._found

    def at(self, values: np.ndarray) -> np.ndarray:
        """The residuals."""
        return self.of(values)[0]

    def jacobian(self, values: np.ndarray) -> np.ndarray:
        """Their derivative by the parameters."""
        return self.of(values)[1]

    def tell(self, values: np.ndarray) -> None:
        """Hands on a point if it is better than those before."""
        squares = self.at(values) ** 2
        cost = 0.5 * float(LOSSES[self.problem.loss](squares).sum())
        if cost < self.best:
            self.best = cost
            if self.told is not None:
                self.told(Best(values.copy(), cost, self.evaluations))


FARTHEST = 10.0
"""Standard deviations from an estimate at which the search for the end of an interval stops."""


class Profile:
    """The least chi squared over all parameters but one, as a function of that one."""

    def __init__(self, of: Fit, index: int):
        self.of, self.index = of, index
        self.model = Residuals(of.problem, None)
        self.others = np.array([k for k in range(len(of.values)) if k != index], int)
        self.least = float(self.model.at(of.values) @ self.model.at(of.values))
        self.near = of.values.copy()
        self.known: dict[float, float] = {}

    def above(self, value: float) -> float:
        """By how much chi squared has grown there less 1. A point that has been looked at has the number
        that it had: a second search of the others would change its last digits, and so the sign of one on
        which chi squared has grown by 1."""
        if value not in self.known:
            self.known[value] = self.grown(value) - 1.0
        return self.known[value]

    def grown(self, value: float) -> float:
        """By how much chi squared has grown where the parameter has this value; infinite if the run fails
        there. The others start where they were at the value before."""
        point = self.near.copy()
        point[self.index] = value
        if not np.isfinite(self.model.at(point)).all():
            return float("inf")
        if len(self.others):
            low, high = (
                np.array([getattr(self.of.problem.parameters[k], end) for k in self.others])
                for end in ("low", "high")
            )

            def whole(others: np.ndarray) -> np.ndarray:
                return np.insert(others, self.index, value)

            found = optimize.least_squares(
                lambda x: self.model.at(whole(x)), np.clip(point[self.others], low, high),
                lambda x: self.model.jacobian(whole(x))[:, self.others], bounds=(low, high),
                x_scale="jac", ftol=1e-8, xtol=TOLERANCE, gtol=None, max_nfev=30,
            )  # fmt: skip
            point = whole(found.x)
        self.near = point
        residuals = self.model.at(point)
        return float(residuals @ residuals) - self.least

    def end(self, sign: float) -> float:
        """Where chi squared has grown by 1 below (sign -1) or above the estimate."""
        estimate, sd = self.of.values[self.index], self.of.sd[self.index]
        parameter = self.of.problem.parameters[self.index]
        bound = parameter.low if sign < 0.0 else parameter.high
        self.near = self.of.values.copy()
        inside, step = estimate, sd
        while True:
            outside = estimate + sign * step
            reached = sign * (outside - bound) >= 0.0
            outside = bound if reached else outside
            if self.above(outside) >= 0.0:
                break
            if reached:
                return float(bound)
            if step >= FARTHEST * sd:
                return float(sign * np.inf)
            inside, step = outside, 1.5 * step
        return float(optimize.brentq(self.above, inside, outside, xtol=1e-3 * sd))


LOSSES: Mapping[str, Callable[[np.ndarray], np.ndarray]] = {
    "linear": lambda z: z,
    "soft_l1": lambda z: 2.0 * (np.sqrt(1.0 + z) - 1.0),
    "huber": lambda z: np.where(z <= 1.0, z, 2.0 * np.sqrt(z) - 1.0),
    "cauchy": np.log1p,
}
"""The losses of `scipy.optimize.least_squares`, as functions of squared residuals."""

SLOPES: Mapping[str, Callable[[np.ndarray], np.ndarray]] = {
    "linear": np.ones_like,
    "soft_l1": lambda z: 1.0 / np.sqrt(1.0 + z),
    "huber": lambda z: np.where(z <= 1.0, 1.0, 1.0 / np.sqrt(np.maximum(z, 1.0))),
    "cauchy": lambda z: 1.0 / (1.0 + z),
}
"""Their derivatives: the weights of residuals."""


def bent(values: np.ndarray, about: Uncertainty, model: Residuals) -> list[str]:
    """Sentences on axes of the error ellipsoid along which chi squared does not grow as that of a normal
    distribution does: by 1 in one standard deviation."""
    least = float(model.at(values) @ model.at(values))
    scale = about.sd
    squares, axes = np.linalg.eigh(about.correlation)
    low, high = (np.array([getattr(p, end) for p in model.problem.parameters]) for end in ("low", "high"))
    said = []
    for part, axis in zip(squares, axes.T, strict=True):
        step = np.sqrt(max(part, 0.0)) * axis * scale
        grown = []
        for sign in (1.0, -1.0):
            point = values + sign * step
            if ((point < low) | (point > high)).any():
                grown.append(np.inf)
                continue
            found = model.at(point)
            square = float(found @ found) - least
            grown.append(square if np.isfinite(square) else np.inf)  # a run that fails is no small error
        if max(abs(x - 1.0) for x in grown) > BENT:
            names = [model.problem.names[k] for k in np.argsort(-np.abs(axis)) if abs(axis[k]) > 0.3]
            said.append(
                f"The errors are not those of a normal distribution along {' and '.join(names)}: one "
                f"standard deviation away chi squared has grown by {grown[0]:.2g} and {grown[1]:.2g} in "
                "place of 1. `profile` gives intervals."
            )
    return said
