"""`esail plot`: the figures of runs and ensembles."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from esail_jax.commands.command_line import ExitCode, UsageError, add_command, refuse_existing


def add(commands: Any) -> None:
    """Adds `esail plot`."""
    plot = add_command(
        commands, "plot", "draw the figures of a run or an ensemble, or compare several runs"
    )
    plot.add_argument(
        "runs", type=Path, nargs="+", metavar="RUN.h5",
        help="run file, or the folder of an ensemble or a design; several runs are drawn on the same axes, "
        "several ensembles are one sample",
    )  # fmt: skip
    plot.add_argument(
        "-o", "--output", required=True, type=Path, metavar="DIR",
        help="folder for the files of all figures; or a file, .png, .pdf or .svg, for one figure of the "
        "`--observables` of one run",
    )  # fmt: skip
    plot.add_argument(
        "--observables", metavar="A,B", help="observables of one figure, one panel above the other"
    )
    plot.add_argument(
        "--calendar", action="store_true", help="dates on the axes of time, for runs with an epoch"
    )
    plot.add_argument("--format", choices=KINDS, help="kind of the files in a folder; png if left out")
    plot.add_argument(
        "--overwrite", action="store_true", help="replace the file of one figure if it exists"
    )


KINDS = ("png", "pdf", "svg")
"""Kinds of files."""


def check(options: argparse.Namespace) -> None:
    """Raises UsageError for options of one figure with a folder, for the others with a file, and for a file
    that exists already."""
    if options.output.suffix[1:].lower() in KINDS:
        if options.observables is None:
            raise UsageError(
                f"`--observables` must be given with the file {options.output}, but is missing"
            )
        if options.format is not None:
            raise UsageError("`--format` must be left out with a file, whose ending says it, but is given")
        if len(options.runs) > 1:
            raise UsageError(f"`RUN.h5` must be one run for one figure, but is {len(options.runs)}")
        refuse_existing(options.output, options.overwrite)
        return
    for name in ("observables", "overwrite"):
        if getattr(options, name):
            must = "be left out unless `-o` is a file (.png, .pdf or .svg)"
            raise UsageError(f"`--{name}` must {must}, but is given")


def run(options: argparse.Namespace) -> ExitCode:
    """Draws the figures of a run file, those that compare several run files, or those of an ensemble or of
    several ensembles as one sample; or one figure of some observables of a run. Prints the path of every
    figure when it is written. Raises RunFileError, and InputError for runs of different models and
    ensembles that do not fit together."""
    check(options)
    if options.observables is not None:
        draw_one(options)
        return ExitCode.DONE
    from esail_jax.ensembles import join, load_ensemble
    from esail_jax.files.opening import RunFileError, files_of, holds_ensemble
    from esail_jax.files.run_file import load
    from esail_jax.plotting import plot_all, write_comparison
    from esail_jax.plotting.ensemble import plot_ensemble

    files, folder = files_of(options.runs), options.output
    how = (tell, options.format or "png", options.calendar)
    if all(holds_ensemble(path) for path in files):
        ensemble = join([load_ensemble(path) for path in files])
        if not ensemble.complete.any():
            raise RunFileError(f"`{options.runs[0]}` must have a member that reached its end, but has none")
        plot_ensemble(ensemble, folder, *how)
    elif len(files) > 1:
        runs = [load(path) for path in files]
        write_comparison(dict(zip(names_of(files), runs, strict=True)), folder, *how)
    else:
        run = load(files[0])
        plot_all(run, folder, modes_of(run), *how)
    return ExitCode.DONE


def draw_one(options: argparse.Namespace) -> None:
    """Writes one figure of the observables of a run. Raises RunFileError and UsageError."""
    from esail_jax.atomic_file import atomic_file
    from esail_jax.files.opening import ArgumentError
    from esail_jax.files.run_file import load
    from esail_jax.plotting.figure_files import write_once
    from esail_jax.plotting.single import draw_together

    run, names = load(options.runs[0]), [name.strip() for name in options.observables.split(",")]
    try:
        figure = draw_together(run, names, options.calendar)
    except ArgumentError:
        raise
    except ValueError as error:
        raise UsageError(str(error).replace("`name`", "`--observables`", 1)) from error
    with atomic_file(options.output) as part:
        write_once(figure, part, options.output.suffix[1:].lower())
    tell(options.output)


def tell(path: Path) -> None:
    """Prints the path of a figure as soon as it is written: a figure takes a second."""
    print(path, flush=True)


def names_of(files: Sequence[Path]) -> list[str]:
    """Names for the runs of several files: file names without their ending, or whole paths if two
    would be the same. Raises UsageError if a file is given twice."""
    if len({path.resolve() for path in files}) < len(files):
        raise UsageError("`RUN.h5` must be different files, but one is given twice")
    stems = [path.stem for path in files]
    return stems if len(set(stems)) == len(files) else [str(path) for path in files]


def modes_of(run: Any) -> Any:
    """The modes of the sail of a run, for the lines in its spectra; None if the run is too short
    for a spectrum, or if its scene has none, which is said. On a terminal a line says what takes some
    seconds."""
    from esail_jax.commands.progress import Progress
    from esail_jax.errors import SimulationError
    from esail_jax.modal.sail_modes import modes
    from esail_jax.observables.saved_rows import leading_finite
    from esail_jax.plotting.data import LEAST_SAMPLES
    from esail_jax.scenes.rules import SceneError

    if run.scene.chain is not None or leading_finite(run.time) < LEAST_SAMPLES:
        return None
    progress = Progress(0.0, lambda *_: ())
    progress.stage("Computing the modes of the sail, for the lines in its spectra")
    try:
        return modes(run.scene, converge=False)
    except (SceneError, SimulationError) as error:
        progress.stage("")
        print(f"The spectra of tether_motion.png have no lines of modes: {error}", flush=True)
        return None
    finally:
        progress.stage("")
