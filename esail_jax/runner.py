"""A run from the command line: file, progress, interruption, summary."""

import os
import sys
import time
from pathlib import Path

import h5py

from esail_jax.march import March, SimulationError
from esail_jax.prepare import prepare
from esail_jax.progress import Progress
from esail_jax.scenes.scene import Scene, parse
from esail_jax.storage import (
    RunFileError,
    RunWriter,
    load_checkpoint,
    open_run,
    plain,
    scene_of_run,
)


def run_scene(scene: Scene, path: Path, resume: bool, quiet: bool) -> int:
    """Run `scene` into the run file `path`; returns the exit status.

    Raises SceneError or RunFileError before anything is written.
    """
    began = time.perf_counter()
    going_on = check_output(scene, path, resume)
    if going_on == "complete":
        return 0
    progress = Progress(scene.integrator.t_end, quiet=quiet)
    prepared = prepare(scene)
    ready = time.perf_counter()
    checkpoint = None
    if going_on == "resume":
        with open_run(path) as file:
            checkpoint = load_checkpoint(file, prepared)
    writer = RunWriter(path, prepared, resume=going_on == "resume")
    march = March(prepared, checkpoint)
    status, message, code = "complete", "", 0

    def times():
        return ready - began, time.perf_counter() - ready

    try:
        for piece in march.pieces():
            progress.update(piece.reached)
            writer.add(piece, march, times())
    except SimulationError as error:
        status, message, code = "failed", str(error), 3
    except KeyboardInterrupt:
        status, message, code = "interrupted", "Interrupted; --resume continues.", 130
    writer.write(march, times(), status, message)
    progress.close()
    if code:
        print(message, file=sys.stderr)
    elif not quiet:
        print(describe(path))
    return code


def check_output(scene: Scene, path: Path, resume: bool) -> str:
    """ "new", "resume" or "complete": what there is to do for this file. Raises RunFileError."""
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
    with open_run(path) as file:
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
        return "resume" if "state" in file else "new"


def describe(path: Path) -> str:
    """What was run, how it ended and how fast: a few lines."""
    with open_run(path) as file:
        attributes = {name: plain(value) for name, value in file.attrs.items()}
        scene = parse(file["scene"][()].decode(), str(path))
        times = file["time"][()]
        terms = ", ".join(file["numerics"].attrs["terms"])
        balance = balance_text(file)
    reached = times[-1] if len(times) else 0.0
    wall = max(attributes["wall_time"], 1e-9)
    steps = attributes["steps"]
    tethers = scene.tethers
    lines = [
        f"{path}: {attributes['status']}",
        f"  {attributes['message']}" if attributes["message"] else "",
        f"  model      {tethers.count} tethers x {tethers.elements} elements: {terms}",
        f"  method     {scene.integrator.method}, step {scene.integrator.step:g} s",
        f"  time       {reached:g} of {scene.integrator.t_end:g} s, {len(times)} saved instants",
        f"  speed      {steps} steps in {wall:.2f} s ({1e6 * wall / max(steps, 1):.0f} us a step, "
        f"{reached / wall:.0f} x real time), compiling {attributes['compile_time']:.2f} s",
        balance,
        f"  device     {attributes['device']}, jax {attributes['version_jax']}, "
        f"Python {attributes['version_python']}, esail_jax {attributes['version_esail_jax']}",
    ]
    return "\n".join(line for line in lines if line)


def balance_text(file: h5py.File) -> str:
    """Largest energy balance error, beside the energies it is an error of."""
    seen = file["observables"]
    if not seen["energy_balance_error"].shape[0]:
        return ""
    error = abs(seen["energy_balance_error"][()]).max()
    energy = (seen["kinetic_energy"][()] + seen["elastic_energy"][()]).max()
    violation = file["numerics/constraint_violation"][()].max()
    return (
        f"  balance    |dE - W + D| <= {error:.2e} J of {energy:.5g} J; "
        f"constraints within {violation:.1e} m"
    )
