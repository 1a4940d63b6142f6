"""`esail plot`: the figures of runs and ensembles."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from esail_jax.commands.command_line import ExitCode, UsageError, add_command


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
        "-o", "--output", required=True, type=Path, metavar="DIR", help="folder for the PNG files"
    )


def run(options: argparse.Namespace) -> ExitCode:
    """Draws the figures of a run file, those that compare several run files, or those of an ensemble or of
    several ensembles as one sample. Prints the path of every figure when it is written. Raises
    RunFileError, and InputError for runs of different models and ensembles that do not fit together."""
    from esail_jax.ensembles import join, load_ensemble
    from esail_jax.files.opening import files_of, holds_ensemble
    from esail_jax.files.run_file import load
    from esail_jax.plotting import plot_all, write_comparison
    from esail_jax.plotting.ensemble import plot_ensemble

    files, folder = files_of(options.runs), options.output
    if all(holds_ensemble(path) for path in files):
        plot_ensemble(join([load_ensemble(path) for path in files]), folder, tell)
    elif len(files) > 1:
        runs = [load(path) for path in files]
        write_comparison(dict(zip(names_of(files), runs, strict=True)), folder, tell)
    else:
        run = load(files[0])
        plot_all(run, folder, modes_of(run), tell)
    return ExitCode.DONE


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
