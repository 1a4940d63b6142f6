"""`esail run`: a run with its file, progress bar, interruption and summary; `esail info` of a run."""

import functools
import os
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from esail_jax.commands.exit_codes import ExitCode
from esail_jax.commands.interrupts import Interrupts
from esail_jax.commands.progress import Progress
from esail_jax.errors import SimulationError
from esail_jax.files.hdf5 import to_python
from esail_jax.files.run_file import (
    Content,
    RunFileError,
    RunWriter,
    load_checkpoint,
    open_run,
    open_single,
    progress_of,
    scene_of_run,
)
from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.scene import Scene, parse
from esail_jax.simulation.host import CompiledScene, HostRun, compile_scene
from esail_jax.steppers.results import RESULTS


def run_scene(scene: Scene, path: Path, resume: bool, quiet: bool) -> ExitCode:
    """Runs `scene` into the run file `path`. Returns the exit code.

    Raises SceneError or RunFileError before anything is written.
    """
    began = time.perf_counter()
    going_on = check_output(scene, path, resume)
    if going_on == "complete":
        return ExitCode.DONE
    progress = Progress(scene.integrator.t_end, functools.partial(progress_text, scene), quiet)
    try:
        compiled = compile_scene(scene)
        ready = time.perf_counter()
        run = HostRun(compiled) if going_on == "new" else resumed(compiled, path)
        writer = RunWriter(path, Content.of_run(compiled), resume=going_on == "resume")
        with Interrupts() as interrupts:
            message, code = write_run(
                run, writer, progress, interrupts, lambda: (ready - began, time.perf_counter() - ready)
            )
    finally:
        progress.close()
    if code:
        print(message, file=sys.stderr)
    elif not quiet:
        print(describe(path))
    return code


def resumed(compiled: CompiledScene, path: Path) -> HostRun:
    """The run that goes on from the checkpoint of a run file. Raises RunFileError unless that holds the
    arrays that this version of the package writes."""
    try:
        with open_run(path) as file:
            checkpoint = load_checkpoint(file)
        return HostRun(compiled, checkpoint)
    except (KeyError, ValueError) as error:
        raise of_another_version(path) from error


def of_another_version(path: Path) -> RunFileError:
    """The error that refuses a run file whose checkpoint this version cannot read."""
    return RunFileError(
        f"`--resume` must continue a run of this version of esail_jax, but {path} is of another"
    )


def write_run(
    run: HostRun,
    writer: RunWriter,
    progress: Progress,
    interrupts: Interrupts,
    times: Callable[[], tuple[float, float]],
) -> tuple[str, ExitCode]:
    """Runs to the end, to a failure or to an interruption. Returns the message and the exit code.

    times(): seconds spent on compiling and on running."""
    ended, code = ("complete", "", RESULTS.successful), ExitCode.DONE
    try:
        for chunk in run.chunks():
            if writer.add(chunk):
                writer.write(progress_of(run, times()))
            progress.update(chunk.reached)
            if interrupts.asked:
                ended = ("interrupted", "Interrupted; --resume continues.", RESULTS.successful)
                code = ExitCode.INTERRUPTED
                break
    except SimulationError as error:
        ended, code = ("failed", str(error), error.result), ExitCode.FAILED
    writer.write(progress_of(run, times(), *ended))
    return ended[1], code


def progress_text(scene: Scene, reached: float, speed: float) -> str:
    """Text beside the progress bar. reached: simulated time [s]; speed: simulated seconds per second."""
    return f"{reached:.0f} of {scene.integrator.t_end:.0f} s  {speed:.0f} x real time"


def check_output(scene: Scene, path: Path, resume: bool) -> str:
    """Tells what is to be done for the file: "new" (start), "resume", or "complete" (nothing).

    Raises RunFileError."""
    if not path.parent.is_dir():
        raise RunFileError(f"`-o` must be in an existing directory, but {path.parent} is none")
    if not os.access(path.parent, os.W_OK):
        raise RunFileError(f"`-o` must be in a writable directory, but {path.parent} is not")
    if path.is_dir():
        raise RunFileError(f"`-o` must be a file, but {path} is a directory")
    if not path.exists():
        return "new"
    if not resume:
        raise RunFileError(f"`-o` must not exist yet (or use --resume), but {path} does")
    with open_single(path) as file:
        before = parse(file["scene"][()].decode(), str(path))
        if scene_of_run(before) != scene_of_run(scene):
            raise RunFileError(
                f"`--resume` must continue the same scene (t_end apart), but {path} holds another"
            )
        done = file["time"].shape[0] and float(file["time"][-1]) == scene.integrator.t_end
        if file.attrs["status"] == "complete" and done:
            return "complete"
        if file.attrs["status"] == "complete" and scene.integrator.t_end < before.integrator.t_end:
            raise RunFileError(
                f"`--t-end` must not end before the finished run ({before.integrator.t_end:g} s), "
                f"but is {scene.integrator.t_end:g}"
            )
        if "state" not in file:
            if file["time"].shape[0]:
                raise RunFileError(f"`--resume` must continue a run with a checkpoint, but {path} has none")
            return "new"
        check_checkpoint(before, scene, file["state"], path)
        return "resume"


def check_checkpoint(before: Scene, scene: Scene, state: h5py.Group, path: Path) -> None:
    """Raises RunFileError unless the run of `scene` passes through the checkpoint of that of `before`."""
    if "motion" not in state:
        raise of_another_version(path)
    rows = int(state.attrs.get("rows", 0))
    if rows and state.parent["time"][rows - 1] > scene.integrator.t_end:
        raise RunFileError(
            f"`--t-end` must not end before the state in {path}, but is {scene.integrator.t_end:g}"
        )
    old, new = (with_method(s).integrator for s in (before, scene))
    if old.method != new.method:
        raise RunFileError("`--t-end` must not change the method of integration, but does")
    if old.step != new.step:
        raise RunFileError(
            f"`--t-end` must let the run go on from the state in {path}, but is {scene.integrator.t_end:g}"
        )


def describe(path: Path) -> str:
    """A few lines on a run: model, method, how it ended, speed, energy balance, versions."""
    with open_run(path) as file:
        attributes = {name: to_python(value) for name, value in file.attrs.items()}
        scene = parse(file["scene"][()].decode(), str(path))
        times = file["time"][()]
        terms = ", ".join(file["numerics"].attrs["terms"])
        balance = balance_text(file)
    reached = times[-1] if len(times) else 0.0
    wall = max(attributes["wall_time"], 1e-9)
    steps = attributes["steps"]
    lines = [
        *heading(path, attributes, scene, terms),
        f"  time       {reached:g} of {scene.integrator.t_end:g} s, {len(times)} saved instants",
        f"  speed      {steps} steps in {wall:.2f} s ({1e6 * wall / max(steps, 1):.0f} us a step, "
        f"{reached / wall:.0f} x real time), compiling {attributes['compile_time']:.2f} s",
        balance,
        f"  device     {attributes['device']}, jax {attributes['version_jax']}, "
        f"Python {attributes['version_python']}, esail_jax {attributes['version_esail_jax']}",
    ]
    return "\n".join(line for line in lines if line)


def heading(path: Path, attributes: Mapping[str, Any], scene: Scene, terms: str) -> list[str]:
    """The first lines for runs and ensembles: status, message, model and method."""
    return [
        f"{path}: {attributes['status']}",
        f"  {attributes['message']}" if attributes["message"] else "",
        f"  model      {size_of(scene)}: {terms}",
        f"  method     {method_of(scene)}",
    ]


def size_of(scene: Scene) -> str:
    """Size of the model: numbers of tethers and elements, or of rods."""
    if scene.chain is not None:
        return f"{scene.chain.rods} rods"
    return f"{scene.tethers.count} tethers x {scene.tethers.elements} elements"


def method_of(scene: Scene) -> str:
    """The method of integration, its tolerance or step, and "(chosen)" if the scene does not name it."""
    table = with_method(scene).integrator
    size = f"tolerance {table.tolerance:g}" if table.step is None else f"step {table.step:g} s"
    return f"{table.method}, {size}" + (" (chosen)" if scene.integrator.method is None else "")


def balance_text(file: h5py.File) -> str:
    """A line with the largest energy error and the energy to compare it with; empty if unknown."""
    seen = file["observables"]
    if not seen.keys() >= {"energy_balance_error", "kinetic_energy", "elastic_energy"}:
        if not seen.keys() >= {"energy_error", "kinetic_energy"}:
            return ""
        error, kinetic = seen["energy_error"][()], seen["kinetic_energy"][()]
        good = np.isfinite(error)
        if not good.any():
            return ""
        largest, energy = abs(error[good]).max(), kinetic[good].max()
        return f"  balance    |E - E_0| <= {largest:.2e} of max(|E_0|, T), T up to {energy:.5g} J"
    good = np.isfinite(seen["energy_balance_error"][()])  # rows after a failure are NaN
    if not good.any():
        return ""
    error = abs(seen["energy_balance_error"][()][good]).max()
    energy = (seen["kinetic_energy"][()] + seen["elastic_energy"][()])[good].max()
    text = f"  balance    |dE - W + D| <= {error:.2e} J of {energy:.5g} J"
    if "constraint_violation" in file["numerics"]:
        text += f"; constraints within {file['numerics/constraint_violation'][()][good].max():.1e} m"
    return text
