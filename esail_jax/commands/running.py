"""`esail run`: a run with its file, progress bar, interruption and summary."""

import dataclasses
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from esail_jax.commands.command_line import ExitCode
from esail_jax.commands.progress import RunProgress
from esail_jax.commands.reports import describe
from esail_jax.compilation.announcements import announced_to
from esail_jax.errors import SimulationError
from esail_jax.files.locks import FileLock
from esail_jax.files.opening import RunFileError, intact, open_run, open_single
from esail_jax.files.reading import scene_in
from esail_jax.files.run_file import (
    Content,
    RunWriter,
    names_of_terms,
    progress_of,
    save_stability,
    scene_of_run,
)
from esail_jax.files.state import load_checkpoint
from esail_jax.interrupts import Interrupts
from esail_jax.loads.law_structure import identity_of
from esail_jax.observables.sail import ON_REQUEST
from esail_jax.scenes.key_reference import ABSENT, differing_keys
from esail_jax.scenes.method_choice import with_method
from esail_jax.scenes.plasma import SolarWind
from esail_jax.scenes.plausibility import doubts
from esail_jax.scenes.scene import Scene
from esail_jax.simulation.host import CompiledScene, HostRun, compile_scene
from esail_jax.simulation.simulate import stability_along
from esail_jax.steppers.results import RESULTS

NODES = "node_position_I"
"""Observable that `--nodes` adds."""

Requested = tuple[str, ...]
"""Names of observables that are saved on request."""


def run_scene(
    scene: Scene,
    path: Path,
    resume: bool,
    quiet: bool,
    requested: Requested = (),
    stability: bool = False,
) -> ExitCode:
    """Runs `scene` into the run file `path`. requested: observables that are saved, too; stability: also
    measure how a small perturbation grows. Returns the exit code.

    Raises SceneError or RunFileError before anything is written.
    """
    check_place(path)
    with FileLock(path):
        return run_alone(scene, path, resume, quiet, requested, stability)


def run_alone(
    scene: Scene, path: Path, resume: bool, quiet: bool, requested: Requested, stability: bool
) -> ExitCode:
    """`run_scene`, as the only process that writes the file."""
    began = time.perf_counter()
    going_on = check_output(scene, path, resume)
    asked = saved_on_request(path, going_on, requested)
    names = names_with(scene, asked) if asked else None
    if going_on == "complete":
        if stability:
            raise RunFileError(f"`--stability` must be given before a run is complete, but {path} is")
        if not quiet:
            print(f"{path} is complete already, up to {scene.integrator.t_end:g} s: nothing is left to run")
        return ExitCode.DONE
    progress = RunProgress(scene, quiet)
    try:
        with announced_to(progress.stage):
            compiled = compile_scene(scene, names=names)
        ready = time.perf_counter()
        run = HostRun(compiled) if going_on == "new" else resumed(compiled, path)
        writer = RunWriter(path, Content.of_run(compiled), resume=going_on == "resume")
        with Interrupts() as interrupts:
            message, code = write_run(
                run, writer, progress, interrupts, lambda: (ready - began, time.perf_counter() - ready)
            )
        if stability and code == ExitCode.DONE:
            save_stability(path, stability_along(scene, scene.integrator.t_end, run.steps))
    finally:
        progress.close()
    if code:
        print(message, file=sys.stderr)
    elif not quiet:
        print(describe(path, said=doubts(scene)))
    return code


def saved_on_request(path: Path, going_on: str, requested: Requested) -> Requested:
    """The observables that a run saves on request: one that goes on saves what it saved before. Raises
    RunFileError if that is to change."""
    if going_on == "new":
        return requested
    with open_single(path) as file, intact(path):
        held = tuple(entry.name for entry in ON_REQUEST if entry.name in file["observables"])
    for name in requested:
        if name not in held:
            option = "`--nodes`" if name == NODES else f"`--save {name}`"
            raise RunFileError(f"{option} must be left out to go on with {path}, but is given")
    return held


def names_with(scene: Scene, requested: Requested) -> tuple[str, ...]:
    """The names of all observables of a sail, and those that are saved on request."""
    from esail_jax.ensembles.member_program import observable_shapes

    return (*observable_shapes(scene), *requested)


def resumed(compiled: CompiledScene, path: Path) -> HostRun:
    """The run that goes on from the checkpoint of a run file. Raises RunFileError unless that holds the
    arrays that this version of the package writes."""
    try:
        with open_run(path) as file, intact(path):
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
    progress: RunProgress,
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
            progress.show(chunk)
            if interrupts.asked:
                ended = ("interrupted", "Interrupted; --resume continues.", RESULTS.successful)
                code = ExitCode.INTERRUPTED
                break
    except SimulationError as error:
        ended, code = ("failed", str(error), error.result), ExitCode.FAILED
    writer.write(progress_of(run, times(), *ended))
    return ended[1], code


def check_place(path: Path) -> None:
    """Raises RunFileError unless a run file can lie at the path."""
    if not path.parent.is_dir():
        raise RunFileError(f"`-o` must be in an existing directory, but {path.parent} is none")
    if not os.access(path.parent, os.W_OK):
        raise RunFileError(f"`-o` must be in a writable directory, but {path.parent} is not")
    if path.is_dir():
        raise RunFileError(f"`-o` must be a file, but {path} is a directory")


def check_output(scene: Scene, path: Path, resume: bool) -> str:
    """Tells what is to be done for the file: "new" (start), "resume", or "complete" (nothing).

    Raises RunFileError."""
    if not path.exists():
        return "new"
    if not resume:
        raise RunFileError(f"`-o` must not exist yet (or use --resume), but {path} does")
    with open_single(path) as file, intact(path):
        before = scene_in(file, path)
        check_law(scene, file.attrs.get("voltage_law"), path)
        check_terms(scene, list(file.attrs.get("own_terms", ())), path)
        if scene_of_run(with_longer_wind(before, scene)) != scene_of_run(scene):
            raise another_scene(before, scene, path)
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


def with_longer_wind(before: Scene, scene: Scene) -> Scene:
    """The scene of a file with the wind of the scene that goes on, if that wind has the rows of the file's
    and others after them: of wind files with dates a scene has the rows that its run needs."""
    old, new = before.solar_wind, scene.solar_wind
    if not isinstance(old, SolarWind) or not isinstance(new, SolarWind) or None in (old.time, new.time):
        return before
    rows, more = rows_of(old), rows_of(new)
    if more.shape[1] < rows.shape[1] or not np.array_equal(more[:, : rows.shape[1]], rows):
        return before
    longer = dataclasses.replace(old, time=new.time, speed=new.speed, number_density=new.number_density)
    return dataclasses.replace(before, solar_wind=longer)


def rows_of(wind: SolarWind) -> np.ndarray:
    """The series of a wind as three rows: times [s], speeds [m/s] and densities [1/m^3]."""
    columns: list[Any] = [wind.time, wind.speed, wind.number_density]
    return np.stack(np.broadcast_arrays(*(np.asarray(x, float) for x in columns)))


def another_scene(before: Scene, scene: Scene, path: Path) -> RunFileError:
    """The error that refuses to go on with another scene than that of the file. It names the first key that
    differs, with both values."""
    keys = differing_keys([before, scene])
    keys.pop("integrator.t_end", None)
    got = f"{path} holds another"
    if keys:
        key, values = next(iter(keys.items()))
        old, new = ("absent" if value == ABSENT else value for value in values)
        others = len(keys) - 1
        more = f" ({others} more key{'s differ' if others > 1 else ' differs'})" if others else ""
        got = f"`{key}` is {old} in {path} and {new} here{more}"
    return RunFileError(f"`--resume` must continue the same scene (t_end apart), but {got}")


def check_law(scene: Scene, before: str | None, path: Path) -> None:
    """Raises RunFileError unless a run goes on under the user's voltage law that the file names."""
    law = None if scene.voltage_law is None else identity_of(scene.voltage_law)
    if law != before:
        must = "be left out" if before is None else f"be {before}"
        got = "is missing" if law is None else f"is {law}"
        if law is not None and before is not None and law.split()[0] == before.split()[0]:
            got += ": the numbers or the methods of the law have changed"
        raise RunFileError(f"`--voltage-law` must {must} to go on with {path}, but {got}")


def check_terms(scene: Scene, before: list[str], path: Path) -> None:
    """Raises RunFileError unless a run goes on under the terms of a user that the file names, in their
    order."""
    terms = names_of_terms(scene)
    if terms != before:
        must, got = (", ".join(x) or "left out" for x in (before, terms))
        got = "are missing" if not terms else f"are {got}"
        if [x.split()[0] for x in terms] == [x.split()[0] for x in before]:
            got += ": the numbers or the methods of a term have changed"
        raise RunFileError(f"`--terms` must be {must} to go on with {path}, but {got}")


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
