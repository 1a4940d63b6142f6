"""`esail design`: chooses the numbers of a scene's voltage law by gradients of the whole run."""

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
    toml_or_text,
)

INFORMATION = "information"
"""Name of the objective of what a run tells of parameters, before a colon and one of them."""

OBJECTIVES_HELP = (
    "mean-torque, attitude, final-attitude, hub-swing, lagging, coning, spin, hub-torque, power and "
    "closeness are made small; of thrust at least 96 %% is retained; spin-plane:A or spin-plane:A,P or "
    "spin-plane:A,P,T turns the spin plane to a sailing angle A and a precession angle P [deg], at the end "
    "or in the mean over the last T seconds; tension:A or tension:A,B keeps the forces between hub and "
    "tethers above A and below B [N], and costs the square of the percentage by which they leave that; "
    "information makes the geometric mean of the variances of the parameters --free small, information:KEY "
    "that of one"
)
"""Objectives of `esail design`, as in `design/objectives.py`."""


def add(commands: Any) -> None:
    """Adds `esail design`."""
    design = add_command(
        commands, "design", "choose the numbers of a scene's voltage law by gradients of the whole run"
    )
    add_scene(design)
    design.add_argument(
        "-o", "--output", required=True, type=Path, metavar="DIR",
        help="folder for the history, the designed scene, the runs before and after, and a figure",
    )  # fmt: skip
    design.add_argument(
        "--objective", action="append", default=[], metavar="NAME=WEIGHT", dest="weights",
        help="an objective and its weight; may be given several times (default: mean-torque=1, thrust=1). "
        f"Every objective but tension is divided by its value at constant voltage: {OBJECTIVES_HELP}",
    )  # fmt: skip
    design.add_argument(
        "--free", action="append", default=[], metavar="KEY",
        help="objectives information and information:KEY: a parameter that the run shall tell, as for "
        "`esail fit`; may be given several times",
    )  # fmt: skip
    design.add_argument(
        "--noise", action="append", default=[], metavar="OBSERVABLE=SD",
        help="the same objectives: what is measured, and its standard deviation; may be repeated",
    )  # fmt: skip
    design.add_argument(
        "--prior", action="append", default=[], metavar="KEY=normal:MEAN:SD",
        help="the same objectives: what is known of a parameter before",
    )  # fmt: skip
    design.add_argument(
        "--iterations", type=int, default=30, metavar="N",
        help="largest number of iterations, those before --resume included (default: %(default)s)",
    )  # fmt: skip
    design.add_argument(
        "--method", choices=("lbfgs", "adam"), default="lbfgs", help="optimiser (default: %(default)s)"
    )
    design.add_argument(
        "--starts", type=int, default=1, metavar="N",
        help="number of starts: the scene's own numbers, and N - 1 random ones about them (default: 1)",
    )  # fmt: skip
    design.add_argument(
        "--seed", type=int, default=0, metavar="K", help="seed of the random starts (default: %(default)s)"
    )
    design.add_argument("--resume", action="store_true", help="continue the design in DIR, if there is one")
    design.add_argument("--quiet", action="store_true", help="print no progress and no summary")


def check(options: argparse.Namespace) -> None:
    """Raises UsageError for numbers of `esail design` that are out of range."""
    for name in ("iterations", "starts"):
        if getattr(options, name) < 1:
            raise UsageError(f"`--{name}` must be positive, but is {getattr(options, name)}")


def objective_weights(options: argparse.Namespace) -> dict[str, float]:
    """Weights from `--objective`, by objective. Raises UsageError."""
    weights = {}
    for text in options.weights:
        name, equals, weight = text.partition("=")
        value = toml_or_text(weight)
        if not equals or isinstance(value, bool) or not isinstance(value, (int, float)):
            raise UsageError(f"`--objective` must look like NAME=WEIGHT, but is {text!r}")
        weights[name.strip()] = float(value)
    return weights


def knowledge(
    options: argparse.Namespace,
) -> tuple[tuple[str, ...], dict[str, float], dict[str, str]]:
    """Parameters, noise and priors of the objective information. Raises UsageError if they are given
    without it."""
    asked = any(text.partition("=")[0].partition(":")[0].strip() == INFORMATION for text in options.weights)
    for name in ("free", "noise"):
        if bool(getattr(options, name)) != asked:
            must, got = ("be given", "is missing") if asked else ("be left out without", "is given")
            raise UsageError(
                f"`--{name}` must {must}{' with' * asked} the objective {INFORMATION}, but {got}"
            )
    if options.prior and not asked:
        raise UsageError(f"`--prior` must be left out without the objective {INFORMATION}, but is given")
    return tuple(options.free), noise_of(options), pairs("--prior", options.prior)


def run(options: argparse.Namespace) -> ExitCode:
    """Designs the voltages of a scene, and writes the history, the runs and a figure. Raises SceneError and
    RunFileError before anything is written."""
    check(options)
    weights, known = objective_weights(options), knowledge(options)
    scene = scene_of(options)
    from esail_jax.commands.designing import Optimisation, run_design, with_information
    from esail_jax.plotting.design import design_figure

    how = Optimisation(options.iterations, options.method, options.starts, options.seed)
    goals = with_information(scene, weights, *known)
    runs_and_history = run_design(scene, options.output, goals, how, options.resume, options.quiet)
    design_figure(*runs_and_history).savefig(options.output / "design.png", dpi=110)
    return ExitCode.DONE
