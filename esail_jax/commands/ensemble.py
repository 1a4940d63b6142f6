"""`esail ensemble`: simulates a scene for many members, each with its own random numbers."""

import argparse
import sys
from pathlib import Path
from typing import Any

from esail_jax.commands.command_line import ExitCode, UsageError, add_command, add_scene, scene_of


def add(commands: Any) -> None:
    """Adds `esail ensemble`."""
    ensemble = add_command(
        commands, "ensemble", "simulate a scene for many members, each with its own random numbers"
    )
    add_scene(ensemble)
    ensemble.add_argument(
        "-o", "--output", required=True, type=Path, metavar="DIR", help="folder for ensemble.h5"
    )
    ensemble.add_argument("--members", type=int, required=True, metavar="N", help="number of members")
    ensemble.add_argument(
        "--seed", type=int, default=0, metavar="K", help="seed of the random numbers (default: %(default)s)"
    )
    ensemble.add_argument(
        "--vary", action="append", default=[], metavar="KEY=DIST", dest="variations",
        help="scene key and its distribution, in the units of the scene: uniform:a:b, normal:mean:sd, "
        "lognormal:median:sigma or grid:a:b:n (n equidistant numbers; several grids form all "
        "combinations). KEY= draws one number for a member, KEY[*]= one for each of its tethers or rods. "
        "May be given several times",
    )  # fmt: skip
    ensemble.add_argument(
        "--sampling", choices=("random", "sobol", "latin"), default="random",
        help="independent draws, a scrambled Sobol sequence, or a Latin hypercube (default: %(default)s)",
    )  # fmt: skip
    ensemble.add_argument(
        "--observables", metavar="NAME,...", help="observables to write to the file (default: all)"
    )
    ensemble.add_argument(
        "--max-steps", type=int, metavar="N",
        help="bound of the steps of a member; one that needs many more has failed (default: no bound)",
    )  # fmt: skip
    ensemble.add_argument(
        "--processes", type=int, metavar="P",
        help="number of processes on this machine (default: one per core); with --coordinator, in all",
    )  # fmt: skip
    ensemble.add_argument(
        "--distributed", action="store_true",
        help="be one of many processes that a cluster has started with the same command",
    )  # fmt: skip
    ensemble.add_argument(
        "--coordinator", metavar="HOST:PORT",
        help="address of process 0, with --distributed; needed only if JAX does not know the cluster",
    )  # fmt: skip
    ensemble.add_argument(
        "--process", type=int, metavar="I", help="number of this process, from 0, with --coordinator"
    )
    ensemble.add_argument(
        "--resume", action="store_true",
        help="compute only the members that DIR lacks; a larger --members adds members",
    )  # fmt: skip
    ensemble.add_argument("--quiet", action="store_true", help="print no progress bar and no summary")


def check(options: argparse.Namespace) -> None:
    """Raises UsageError for options of `esail ensemble` that are out of range or do not fit together."""
    for name, least in (
        ("members", 1), ("seed", 0), ("max-steps", 1), ("processes", 1), ("process", 0),
    ):  # fmt: skip
        value = getattr(options, name.replace("-", "_"))
        if value is not None and value < least:
            must = "be positive" if least else "not be negative"
            raise UsageError(f"`--{name}` must {must}, but is {value}")
    given = [getattr(options, name) is not None for name in ("coordinator", "process")]
    if any(given) and not options.distributed:
        raise UsageError("`--coordinator` and `--process` must come with --distributed, but do not")
    if any(given) and not (all(given) and options.processes is not None):
        raise UsageError("`--coordinator` must come with --process and --processes, but does not")
    if options.distributed and not any(given) and options.processes is not None:
        raise UsageError(
            "`--processes` must be left to the cluster, or come with --coordinator, but is given"
        )


def observable_names(options: argparse.Namespace) -> list[str] | None:
    """Names from `--observables`; None for all."""
    if options.observables is None:
        return None
    return [name.strip() for name in options.observables.split(",")]


def run(options: argparse.Namespace) -> ExitCode:
    """Computes an ensemble. Cores are shared and a cluster is joined before JAX starts any computation.
    Raises SceneError, VariationError and RunFileError before anything is written."""
    check(options)
    scene, names = scene_of(options), observable_names(options)
    if options.distributed:
        from esail_jax.commands.cluster import join_cluster

        join_cluster(options.coordinator, options.processes, options.process)
    else:
        from esail_jax.cores import share_cores

        share_cores(options.processes)
    from esail_jax.commands.ensemble_here import run_here, task_of

    task = task_of(
        scene, options.members, options.variations, options.seed, options.sampling, names, options.max_steps
    )
    if options.members > 1 and not options.variations and not options.quiet:
        print("Without --vary all members are equal.", file=sys.stderr)
    if options.distributed:
        from esail_jax.commands.cluster import run_distributed

        return run_distributed(task, options.output, options.resume, options.quiet)
    return run_here(task, options.output, options.processes, options.resume, options.quiet)
