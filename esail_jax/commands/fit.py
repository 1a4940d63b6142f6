"""`esail fit`: numbers of a scene from the telemetry of its run, with error bars."""

import argparse
from pathlib import Path
from typing import Any

from esail_jax.commands.command_line import (
    ExitCode,
    UsageError,
    add_command,
    add_scene,
    noise_of,
    pairs,
    scene_of,
)


def add(commands: Any) -> None:
    """Adds `esail fit`."""
    fit = add_command(
        commands,
        "fit",
        "fit numbers of a scene to the telemetry of its run, and say how well they are known",
    )
    add_scene(fit)
    fit.add_argument(
        "data", type=Path, nargs="+", metavar="DATA.csv",
        help="measurements, with columns of `esail export` (empty cells are missing); several files are "
        "several runs of the scene",
    )  # fmt: skip
    fit.add_argument(
        "-o", "--output", required=True, type=Path, metavar="DIR",
        help="folder for fit.json, the fitted scene, its run, and figures",
    )  # fmt: skip
    fit.add_argument(
        "--free", action="append", required=True, metavar="KEY",
        help="a parameter: KEY, KEY[2] or KEY[*] of the scene, bias.OBSERVABLE[i] or "
        "misalignment.OBSERVABLE[*] of an instrument; may be given several times",
    )  # fmt: skip
    fit.add_argument(
        "--noise", action="append", required=True, metavar="OBSERVABLE=SD",
        help="standard deviation of a measured observable, in its unit; may be given several times",
    )  # fmt: skip
    fit.add_argument(
        "--prior", action="append", default=[], metavar="KEY=normal:MEAN:SD",
        help="what is known of a parameter before; may be given several times",
    )  # fmt: skip
    fit.add_argument(
        "--loss", choices=("linear", "soft_l1", "huber", "cauchy"), default="linear",
        help="how residuals count: as those of normal noise, or less where they are outliers (default: "
        "%(default)s)",
    )  # fmt: skip
    fit.add_argument(
        "--profile", action="append", default=[], metavar="KEY",
        help="also find the interval of this parameter by its likelihood, where error bars are not enough",
    )  # fmt: skip
    fit.add_argument(
        "--evaluations", type=int, default=50, metavar="N",
        help="most runs with derivatives (default: %(default)s)",
    )  # fmt: skip
    fit.add_argument("--resume", action="store_true", help="go on with the fit in DIR, if there is one")
    fit.add_argument("--quiet", action="store_true", help="print no progress and no summary")


def run(options: argparse.Namespace) -> ExitCode:
    """Fits a scene and writes the files. Raises SceneError, UsageError and RunFileError before anything is
    written, and SimulationError if the run at the start fails."""
    if options.evaluations < 1:
        raise UsageError(f"`--evaluations` must be positive, but is {options.evaluations}")
    noise, priors = noise_of(options), pairs("--prior", options.prior)
    from esail_jax.commands.fitting import run_fit

    return run_fit(scene_of(options), options, noise, priors)
