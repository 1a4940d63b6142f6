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
        "--reduce", metavar="NAME,...",
        help="keep of every observable only these numbers in place of its history: mean, max, min, final, "
        "or module:function",
    )  # fmt: skip
    ensemble.add_argument(
        "--engine", default="local", metavar="NAME",
        help="what computes the members: local (processes of this machine), dask:ADDRESS (the workers of a "
        "Dask scheduler), or mpi (the ranks of `mpiexec -n P python -m mpi4py.futures -m esail_jax ...`; "
        "default: %(default)s)",
    )  # fmt: skip
    ensemble.add_argument(
        "--processes", type=int, metavar="P",
        help="number of processes on this machine (default: one per core)",
    )  # fmt: skip
    ensemble.add_argument(
        "--resume", action="store_true",
        help="compute only the members that DIR lacks; a larger --members adds members",
    )  # fmt: skip
    ensemble.add_argument("--quiet", action="store_true", help="print no progress bar and no summary")


def check(options: argparse.Namespace) -> None:
    """Raises UsageError for options of `esail ensemble` that are out of range or do not fit together."""
    for name, least in (("members", 1), ("seed", 0), ("max-steps", 1), ("processes", 1)):
        value = getattr(options, name.replace("-", "_"))
        if value is not None and value < least:
            must = "be positive" if least else "not be negative"
            raise UsageError(f"`--{name}` must {must}, but is {value}")


def names_in(text: str | None) -> list[str] | None:
    """The names in a list of an option; None for an option that is not given."""
    return None if text is None else [name.strip() for name in text.split(",")]


def run(options: argparse.Namespace) -> ExitCode:
    """Computes an ensemble. The number of threads is set before JAX starts any computation. Raises
    SceneError, VariationError and RunFileError before anything is written."""
    check(options)
    scene = scene_of(options)
    from esail_jax.cores import one_thread

    one_thread()
    from esail_jax.commands.ensemble_progress import compute
    from esail_jax.ensembles.engines import engine_of
    from esail_jax.ensembles.task import task_of

    engine = engine_of(options.engine, options.processes)
    task = task_of(
        scene, options.members, options.variations, options.seed, options.sampling,
        names_in(options.observables), options.max_steps, names_in(options.reduce) or (),
    )  # fmt: skip
    if options.members > 1 and not options.variations and not options.quiet:
        print("Without --vary all members are equal.", file=sys.stderr)
    return compute(task, options.output, engine, options.resume, options.quiet)
