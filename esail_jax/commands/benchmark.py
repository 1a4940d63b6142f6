"""Error against run time on this machine: `esail bench`, and the core of `experiments/work_precision`.

Every method runs a scene at several steps or tolerances. The reference is the most accurate method at a
tolerance near rounding. A second run at ten times that tolerance measures the error of the reference.
"""

import dataclasses
import importlib.metadata
import json
import os
import platform
import statistics
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from esail_jax.compilation.size import Size, size_of
from esail_jax.cores import cores, processor
from esail_jax.observables import chain, sail
from esail_jax.scenes.scene import Scene
from esail_jax.simulation.host import compile_scene
from esail_jax.simulation.simulate import simulate
from esail_jax.simulation.solution import Solution

Curve = tuple[str, str, tuple[float, ...]]
"""A method, the key it varies (`step` [s] or `tolerance`), and the values of that key."""

SAIL: tuple[Curve, ...] = (
    ("generalized-alpha", "step", (0.4, 0.1)),
    ("collocation", "tolerance", (1e-6, 1e-8, 1e-10)),
)
CHAIN: tuple[Curve, ...] = (
    ("tsit5", "tolerance", (1e-6, 1e-8, 1e-10)),
    ("dopri8", "tolerance", (1e-6, 1e-8, 1e-10)),
)
"""The curves of `esail bench`, for sails and for chains. The baseline takes one to two minutes, half of
them for compiling."""

REFERENCE = {"sail": ("collocation", 1e-13), "chain": ("dopri8", 1e-13)}
"""Method and tolerance of the reference, for sails (`tethers`) and for chains."""

MOST_UNCERTAIN = 1e-4
"""Largest error of the reference, over the observable's range, for an observable to be compared. An
observable that is zero by symmetry is not compared: its range is rounding."""

LEAST_RANGE = 1e-3
"""A signal's range is taken to be at least this fraction of its magnitude. Otherwise the error of a nearly
constant signal would be divided by rounding errors."""

ANGLES = {entry.name for entry in (*sail.OBSERVABLES, *chain.OBSERVABLES) if entry.unit == "rad"}
"""Names of the observables that are angles. They are compared modulo a turn."""

OWN_ERRORS = ("energy_balance_error", "energy_error")
"""Observables that measure the error of a run. They are not compared."""

RUNS = 3
"""Number of runs, whose median is the run time. No run time includes compiling."""


class NoReference(RuntimeError):
    """The reference could not be computed accurately enough."""


# ---- error --------------------------------------------------------------------------------------


def errors(rows: Mapping[str, Any], exact: Mapping[str, Any], names: Iterable[str]) -> dict[str, float]:
    """Errors by observable: the largest difference over time and components, divided by the range of the
    exact observable. NaN for a run that did not reach its end."""
    result = {}
    for name in names:
        difference, y = np.asarray(rows[name]) - exact[name], np.asarray(exact[name])
        if name in ANGLES:
            difference = (difference + np.pi) % (2.0 * np.pi) - np.pi
        width = max(np.ptp(y), LEAST_RANGE * np.abs(y).max(), np.finfo(float).tiny)
        result[name] = float(np.abs(difference).max() / width)
    return result


def worst(error: Mapping[str, float]) -> str:
    """Name of the observable with the largest error. NaN counts as the largest."""
    return max(error, key=lambda name: np.inf if np.isnan(error[name]) else error[name])


# ---- time ---------------------------------------------------------------------------------------


def yardstick() -> float:
    """Speed of a 400 x 400 float64 product in this process [GFLOP/s], median of 25."""
    matrix = jax.random.normal(jax.random.key(0), (400, 400), float)
    product = jax.jit(lambda a: a @ a)
    jax.block_until_ready(product(matrix))
    seconds = statistics.median(seconds_of(lambda: product(matrix)) for _ in range(25))
    return 2.0 * 400**3 / seconds / 1e9


def seconds_of(call: Callable[[], Any]) -> float:
    """Wall time of a call [s]."""
    began = time.perf_counter()
    jax.block_until_ready(call())
    return time.perf_counter() - began


def machine() -> dict[str, Any]:
    """Device, cores and versions, on which the times depend."""
    packages = ("esail_jax", "jax", "jaxlib", "numpy")
    return {
        "device": f"{jax.devices()[0].platform}: {processor('model name')}",
        "cores": cores(),
        "versions": {"python": platform.python_version()}
        | {name: importlib.metadata.version(name) for name in packages},
    }


class Run(NamedTuple):
    """Runs of a scene by one method at one setting.

    key, value: `step` [s] or `tolerance`; seconds: wall time of every run without compiling; processor:
    processor time [s] of every run but the first, more reliable than wall time on a shared core; message:
    from `Solution.stats`; sizes: of the programs that compute the start, the steps and the observables."""

    method: str
    key: str
    value: float
    rows: Mapping[str, Any]
    steps: int
    compile_s: float
    seconds: tuple[float, ...]
    processor: tuple[float, ...] = ()
    message: str = ""
    sizes: Mapping[str, Size] = {}


def with_method(scene: Scene, method: str, key: str, value: float) -> Scene:
    """The scene with another method, and a step or a tolerance, in place of its own."""
    table: dict[str, Any] = dict.fromkeys(("step", "tolerance", "spectral_radius"))
    table |= {"method": method, key: value}
    return dataclasses.replace(scene, integrator=dataclasses.replace(scene.integrator, **table))


def measure(scene: Scene, method: str, key: str, value: float, runs: int = RUNS) -> Run:
    """Runs a scene several times by one method at one setting."""
    scene = with_method(scene, method, key, value)
    first, seconds, processor = simulate(scene, throw=False), [], []
    seconds.append(first.stats["wall_time"])
    for _ in range(runs - 1):
        began = time.process_time()
        seconds.append(simulate(scene, throw=False).stats["wall_time"])
        processor.append(time.process_time() - began)
    compile_s, message = first.stats["compile_time"], first.stats["message"]
    times = tuple(seconds), tuple(processor)
    return Run(
        method, key, value, rows_of(first), first.steps, compile_s, *times, message, program_sizes(scene)
    )


def program_sizes(scene: Scene) -> dict[str, Size]:
    """The sizes of the programs of a scene that has been run."""
    programs = compile_scene(scene).programs
    parts = {"start": programs.start, "advance": programs.advance, "look": programs.look}
    return {name: size_of(part.program) for name, part in parts.items()}


def rows_of(solution: Solution) -> dict[str, Any]:
    """Observables of a solution by name."""
    return {name: solution[name] for name in solution.observables}


# ---- both ---------------------------------------------------------------------------------------


class Reference(NamedTuple):
    """The observables that are taken to be exact.

    names: those that are accurate enough to be compared; doubt: errors of the second run, by observable."""

    rows: Mapping[str, Any]
    names: tuple[str, ...]
    doubt: dict[str, float]


def reference_of(best: Run, second: Run) -> Reference:
    """The reference from the best run and a second one, with the names of the observables that agree."""
    doubt = errors(second.rows, best.rows, [name for name in best.rows if name not in OWN_ERRORS])
    names = tuple(name for name, error in doubt.items() if error < MOST_UNCERTAIN)
    return Reference(best.rows, names, doubt)


def line(run: Run, error: Mapping[str, float], **more: Any) -> dict[str, Any]:
    """A run as a JSON line, with the speed of the machine just after the run. Errors that are no finite
    number are None."""
    name = worst(error)
    known = {signal: x if np.isfinite(x) else None for signal, x in error.items()}
    typical = statistics.median(run.seconds)
    return more | {
        "method": run.method,
        run.key: run.value,
        "steps": run.steps,
        "compile_s": run.compile_s,
        "run_s": typical,
        "runs_s": run.seconds,
        "processor_s": statistics.median(run.processor) if run.processor else None,
        "us_per_step": 1e6 * typical / max(run.steps, 1),
        "worst_error": known[name],
        "worst_observable": name,
        "errors": known,
        "message": run.message,
        "equations": {name: size.equations for name, size in run.sizes.items()},
        "instructions": {name: size.instructions for name, size in run.sizes.items()},
        "yardstick_gflops": yardstick(),
    }


def reference_line(scene: Scene) -> tuple[Reference, dict[str, Any]]:
    """The reference of a scene and its JSON line, whose errors are those of the second run.

    Raises NoReference if no observable is accurate enough."""
    method, tolerance = REFERENCE[scene.model]
    best, second = (measure(scene, method, "tolerance", t, 1) for t in (tolerance, 10.0 * tolerance))
    reference = reference_of(best, second)
    if not reference.names:
        reason = best.message or second.message or "two runs agree on nothing"
        raise NoReference(f"no reference by {method} at {tolerance:g}: {reason}")
    kept = {name: reference.doubt[name] for name in reference.names}
    left_out = [name for name in reference.doubt if name not in kept]
    return reference, line(best, kept, role="reference", left_out=left_out)


def bench(scene: Scene, curves: Iterable[Curve], runs: int = RUNS) -> Iterator[dict[str, Any]]:
    """JSON lines of a scene: the reference, then every method at every setting."""
    reference, first = reference_line(scene)
    yield first
    for method, key, values in curves:
        for value in values:
            run = measure(scene, method, key, value, runs)
            yield line(run, errors(run.rows, reference.rows, reference.names), role="run")


# ---- the command --------------------------------------------------------------------------------

COLUMNS = ("method", "setting", "steps", "compile s", "run s", "us/step", "median", "worst error/range")


def table_row(entry: Mapping[str, Any]) -> tuple[str, ...]:
    """A JSON line as a row of the table `COLUMNS`."""
    key = "step" if "step" in entry else "tolerance"
    times = f"{entry['compile_s']:.2f}", f"{entry['run_s']:.3f}", f"{entry['us_per_step']:.1f}"
    if entry["worst_error"] is None:
        median, worst = "-", entry["message"]
    else:
        median = f"{statistics.median(entry['errors'].values()):.1e}"
        worst = f"{entry['worst_error']:.1e} {entry['worst_observable']}"
    if entry["role"] == "reference":
        worst += " (reference, in itself)"
    return entry["method"], f"{key} {entry[key]:g}", str(entry["steps"]), *times, median, worst


def text_of(cells: tuple[str, ...]) -> str:
    """Cells of a row as aligned text."""
    widths = (-18, -16, 8, 9, 8, 8, 8)
    fixed = [f"{x:<{-w}}" if w < 0 else f"{x:>{w}}" for x, w in zip(cells, widths, strict=False)]
    return "  ".join([*fixed, cells[-1]])


def run_bench(scene: Scene, json_file: Path | None = None) -> None:
    """Prints the table row by row, and writes the JSON lines to a file if one is given."""
    about = {"t_end": scene.integrator.t_end, "interval": scene.output.interval} | machine()
    speeds, sizes = [], {}
    with open(json_file or os.devnull, "w", encoding="utf-8") as file:
        print(f"{about['t_end']:g} s, saved every {about['interval']:g} s; run s: median of {RUNS}")
        print(text_of(COLUMNS), flush=True)
        for entry in bench(scene, SAIL if scene.chain is None else CHAIN):
            print(text_of(table_row(entry)), flush=True)
            print(json.dumps(entry | about), file=file, flush=True)
            speeds.append(entry["yardstick_gflops"])
            sizes[entry["method"]] = entry["equations"], entry["instructions"]
            if entry.get("left_out"):
                names = ", ".join(entry["left_out"])
                print(f"not compared, unknown to {MOST_UNCERTAIN:g} of the range: {names}")
    for method, (equations, instructions) in sizes.items():
        parts = ", ".join(f"{name} {equations[name]} ({instructions[name]})" for name in equations)
        print(f"equations (compiled instructions) of {method}: {parts}")
    print(f"{about['device']}, {about['cores']} cores; ", end="")
    print(f"400 x 400 product at {min(speeds):.0f} to {max(speeds):.0f} GFLOP/s")
