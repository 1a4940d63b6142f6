"""`esail run`: simulates a scene and writes its run file."""

import argparse
from pathlib import Path
from typing import Any

from esail_jax.commands.command_line import ExitCode, UsageError, add_command, add_scene, scene_of


def add(commands: Any) -> None:
    """Adds `esail run`."""
    run = add_command(commands, "run", "simulate a scene and write its run file")
    add_scene(run)
    run.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="RUN.h5",
        help="run file to write (HDF5; any name, usually *.h5); must be given, except with --estimate",
    )
    run.add_argument(
        "--resume", action="store_true", help="continue RUN.h5 from its last checkpoint, if it exists"
    )
    run.add_argument(
        "--nodes", action="store_true", help="also save the positions of all nodes (node_position_I)"
    )
    run.add_argument(
        "--save", metavar="A,B",
        help="also save these observables, which are saved on request only (see the list of observables)",
    )  # fmt: skip
    run.add_argument(
        "--stability",
        action="store_true",
        help="also measure how a small perturbation of the start grows, and warn of chaotic motion",
    )
    run.add_argument(
        "--estimate",
        action="store_true",
        help="write nothing, but try the first seconds of the run, and print how many steps the run will "
        "take, how long, and how large its file and its memory will be",
    )
    run.add_argument(
        "--voltage-law",
        metavar="FILE.py:NAME",
        help="voltage law of your own: an object in a Python file, or a class or function that gives one",
    )
    run.add_argument(
        "--terms",
        metavar="FILE.py:NAME",
        action="append",
        help="physics of your own: a term or a list of terms in a Python file, or a class or function that "
        "gives one; may be repeated",
    )
    run.add_argument("--quiet", action="store_true", help="print no progress bar and no summary")


def check(options: argparse.Namespace) -> None:
    """Raises UsageError for options of `esail run` that are missing or do not fit together."""
    if options.output is None and not options.estimate:
        raise UsageError("`-o RUN.h5` must be given (or `--estimate`), but is missing")
    for name in ("output", "resume", "stability"):
        if options.estimate and getattr(options, name):
            given = "-o" if name == "output" else f"--{name}"
            raise UsageError(f"`{given}` must be left out with --estimate, but is given")


def run(options: argparse.Namespace) -> ExitCode:
    """Runs a scene, or estimates what its run will cost. Raises SceneError or RunFileError before anything
    is written."""
    check(options)
    scene = scene_of(options)
    requested = requested_by(options, scene)
    if options.estimate:
        from esail_jax.commands.estimate import print_estimate

        print_estimate(scene, requested, options.quiet)
        return ExitCode.DONE
    from esail_jax.commands.running import run_scene

    return run_scene(scene, options.output, options.resume, options.quiet, requested, options.stability)


def requested_by(options: argparse.Namespace, scene: Any) -> tuple[str, ...]:
    """The observables that are saved on request. Raises UsageError for names that are none, and that the
    scene has not."""
    asked = [] if options.save is None else [name.strip() for name in options.save.split(",")]
    for option, given in (("--nodes", options.nodes), ("--save", asked)):
        if given and scene.chain is not None:
            raise UsageError(f"`{option}` must be left out with a chain, but is given")
    nodes = ("node_position_I",) if options.nodes else ()
    if not asked:
        return nodes
    from esail_jax.errors import nearest
    from esail_jax.observables.entry import in_words
    from esail_jax.observables.sail import ON_REQUEST

    needs = {entry.name: entry.needs for entry in ON_REQUEST}
    for name in asked:
        if name not in needs:
            hint = nearest(name, needs) or f" ({', '.join(needs)})"
            raise UsageError(
                f"`--save` must be observables that are saved on request, but has {name!r}{hint}"
            )
        if needs[name] and getattr(scene, needs[name]) is None:
            raise UsageError(
                f"`--save {name}` must be left out without {in_words(needs[name])}, but is given"
            )
    return tuple(dict.fromkeys((*nodes, *asked)))
