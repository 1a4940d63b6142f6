"""`esail fit`: the fit, its files, and going on with it.

The folder holds progress.json (the best point, while the fit goes on), and at its end fit.json (the
result), fitted.toml (the scene with the estimates), run.h5 (its run) and figures.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from esail_jax.atomic_file import atomic_file
from esail_jax.commands.command_line import ExitCode, UsageError
from esail_jax.commands.designing import check_folder
from esail_jax.commands.progress import Progress
from esail_jax.commands.running import names_with
from esail_jax.files.locks import FileLock
from esail_jax.files.opening import RunFileError
from esail_jax.files.run_file import save
from esail_jax.identification.fit import Best, Fit, Problem
from esail_jax.identification.fit_file import (
    PROGRESS,
    RESULT,
    read_progress,
    result_of,
    write_json,
    write_progress,
)
from esail_jax.observables.sail import ON_REQUEST
from esail_jax.plotting.figure_files import write_figures
from esail_jax.plotting.fit import figures_of_fit
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.toml_text import to_toml
from esail_jax.simulation.simulate import simulate


def run_fit(
    scene: Scene, options: argparse.Namespace, noise: Mapping[str, float], priors: Mapping[str, str]
) -> ExitCode:
    """Fits a scene to the data files of the options, and writes the files. Returns the exit code."""
    folder = options.output
    if (folder / RESULT).exists():
        if options.resume:
            if not options.quiet:
                print(f"{folder / RESULT} is complete already: nothing is left to fit")
            return ExitCode.DONE
        raise RunFileError(f"`{folder / RESULT}` must not exist, but does")
    if (folder / PROGRESS).exists() and not options.resume:
        raise RunFileError(f"`{folder / PROGRESS}` must not exist (or ask for --resume), but does")
    problem = Problem.of(scene, list(options.data), options.free, noise, priors, options.loss)
    check_profiles(options.profile, problem.names, options.loss)
    identity = {
        "parameters": list(problem.names), "scene": to_toml(scene), "noise": dict(noise),
        "priors": dict(priors), "loss": options.loss, "data": [str(path) for path in options.data],
    }  # fmt: skip
    check_folder(folder)
    start = read_progress(folder / PROGRESS, identity) if (folder / PROGRESS).exists() else None
    folder.mkdir(parents=True, exist_ok=True)
    progress = Progress(float(options.evaluations), lambda *_: (), options.quiet)
    progress.stage("Compiling the run with its derivatives")

    def told(best: Best) -> None:
        write_progress(folder / PROGRESS, best, identity)
        if not options.quiet:
            progress.stage("")
            values = ", ".join(f"{x:.6g}" for x in best.values)
            print(f"evaluation {best.evaluations}: cost {best.cost:.6g} at {values}", file=sys.stderr)

    with FileLock(folder / RESULT):
        try:
            found = problem.solved(start, options.evaluations, told)
            progress.stage("")
            profiles = {name: found.profile(name) for name in options.profile}
        except KeyboardInterrupt:
            kept = (folder / PROGRESS).exists()
            hint = f"{folder / PROGRESS} has the best point" if kept else "there is no point yet"
            print(f"interrupted: {hint}; --resume goes on", file=sys.stderr)
            return ExitCode.INTERRUPTED
        save_fit(found, profiles, folder)
        (folder / PROGRESS).unlink(missing_ok=True)
    if not options.quiet:
        print(found)
        for name, (low, high) in profiles.items():
            print(f"  {name} lies between {low:.6g} and {high:.6g} (68 %, by its likelihood)")
        print(folder / RESULT)
    return ExitCode.DONE


def check_profiles(names: Sequence[str], parameters: Sequence[str], loss: str) -> None:
    """Raises UsageError for a profile of what is no parameter, and under a loss by which chi squared is not
    least."""
    for name in names:
        if name not in parameters:
            must = f"be a free parameter ({', '.join(parameters)})"
            raise UsageError(f"`--profile` must {must}, but is {name!r}")
    if names and loss != "linear":
        raise UsageError(f"`--loss` must be linear for a profile, but is {loss}")


def save_fit(fit: Fit, profiles: Mapping[str, tuple[float, float]], folder: Path) -> None:
    """Writes fitted.toml, run.h5, the figures, and fit.json last: where it is, all is."""
    instruments = [
        f"# {parameter.name} = {value:.17g}  # {parameter.unit}\n"
        for parameter, value in zip(fit.problem.parameters, fit.values, strict=True)
        if parameter.of_instrument
    ]
    with atomic_file(folder / "fitted.toml") as part:
        part.write_text("".join([*instruments, to_toml(fit.scene)]), encoding="utf-8")
    measured = {name for data in fit.data for name in data.names}
    requested = tuple(entry.name for entry in ON_REQUEST if entry.name in measured)
    names = names_with(fit.scene, requested) if requested else None
    save(simulate(fit.scene, save=names), folder / "run.h5", overwrite=True)
    write_figures(figures_of_fit(fit), folder)
    write_json(folder / RESULT, result_of(fit, profiles))
