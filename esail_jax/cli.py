"""The command `esail`: run, scenes, init, info, plot, export, animate, view, modes, ensemble, design,
bench, cache, completion.

The options are those of `commands/parser.py`, the exit codes those of `commands/exit_codes.py`. Errors are
one line on stderr.
"""

import argparse
import contextlib
import os
import select
import signal
import sys
import threading
from typing import TYPE_CHECKING

from esail_jax.commands.exit_codes import ExitCode
from esail_jax.commands.options import (
    UsageError,
    check_animate,
    check_design,
    check_ensemble,
    check_export,
    check_modes,
    check_run,
    check_view,
    objective_weights,
    observable_names,
    settings,
)
from esail_jax.commands.parser import parser
from esail_jax.errors import InputError, NoSpaceError, SimulationError, sentence_of

if TYPE_CHECKING:
    from esail_jax.scenes.scene import Scene


def scene_of(options: argparse.Namespace) -> "Scene":
    """Reads and checks the scene of a command, before JAX is imported: an error is reported at once, and so
    is a number that may be in a wrong unit."""
    from esail_jax.scenes.loading import load_scene
    from esail_jax.scenes.own_terms import OWN_TERMS
    from esail_jax.scenes.plausibility import doubts, without_effect
    from esail_jax.scenes.voltage import OWN_LAW, MissingLaw

    overrides = settings(options)
    if getattr(options, "voltage_law", None) is not None:
        from esail_jax.commands.own_objects import read_law

        overrides[OWN_LAW] = read_law(options.voltage_law)
    if getattr(options, "terms", None):
        from esail_jax.commands.own_objects import read_terms

        overrides[OWN_TERMS] = read_terms(options.terms)
    try:
        scene = load_scene(options.scene, overrides)
    except MissingLaw as error:
        raise missing_law(options) from error
    if not getattr(options, "quiet", False):
        for sentence in (*doubts(scene), *without_effect(scene)):
            print(sentence, file=sys.stderr)
    return scene


def missing_law(options: argparse.Namespace) -> UsageError:
    """Returns the error for a scene of a user's law without the law: it names the option that gives it, if
    the command has one."""
    if hasattr(options, "voltage_law"):
        return UsageError(
            '`--voltage-law FILE.py:NAME` must be given with `voltage.law` = "python", but is missing'
        )
    return UsageError(
        f"`voltage.law` must be a law of the package for `esail {options.command}`, which takes no "
        '`--voltage-law`, but is "python"'
    )


def run(options: argparse.Namespace) -> ExitCode:
    """`esail run`."""
    check_run(options)
    scene = scene_of(options)
    if options.nodes and scene.chain is not None:
        raise UsageError("`--nodes` must be left out with a chain, but is given")
    if options.estimate:
        from esail_jax.commands.estimate import print_estimate

        print_estimate(scene, options.nodes, options.quiet)
        return ExitCode.DONE
    from esail_jax.commands.run import run_scene

    return run_scene(scene, options.output, options.resume, options.quiet, options.nodes, options.stability)


def scenes(_: argparse.Namespace) -> ExitCode:
    """`esail scenes`."""
    from esail_jax.commands.scenes import list_scenes

    list_scenes()
    return ExitCode.DONE


def init(options: argparse.Namespace) -> ExitCode:
    """`esail init`."""
    from esail_jax.commands.init import write_scene

    write_scene(options.name, options.output)
    return ExitCode.DONE


def info(options: argparse.Namespace) -> ExitCode:
    """`esail info`."""
    from esail_jax.commands.info import print_info

    print_info(options.runs)
    return ExitCode.DONE


def plot(options: argparse.Namespace) -> ExitCode:
    """`esail plot`."""
    from esail_jax.commands.plot import draw_files

    draw_files(options.runs, options.output)
    return ExitCode.DONE


def export(options: argparse.Namespace) -> ExitCode:
    """`esail export`."""
    check_export(options)
    from esail_jax.commands.export import export_run

    export_run(options.run, options.output)
    return ExitCode.DONE


def animate(options: argparse.Namespace) -> ExitCode:
    """`esail animate`."""
    check_animate(options)
    from esail_jax.commands.animate import write_animation

    write_animation(options)
    return ExitCode.DONE


def view(options: argparse.Namespace) -> ExitCode:
    """`esail view`."""
    check_view(options)
    from esail_jax.commands.view import write_page

    write_page(options)
    return ExitCode.DONE


def modes(options: argparse.Namespace) -> ExitCode:
    """`esail modes`."""
    check_modes(options)
    scene = scene_of(options)
    from esail_jax.commands.modes import print_modes

    print_modes(scene, options.json, options.output, options.count, options.floquet)
    return ExitCode.DONE


def design(options: argparse.Namespace) -> ExitCode:
    """`esail design`."""
    check_design(options)
    weights, scene = objective_weights(options), scene_of(options)
    from esail_jax.commands.design import Optimisation, run_design

    how = Optimisation(options.iterations, options.method, options.starts, options.seed)
    found = run_design(scene, options.output, weights, how, options.resume, options.quiet)
    from esail_jax.commands.plot import draw_design

    draw_design(*found, options.output)
    return ExitCode.DONE


def ensemble(options: argparse.Namespace) -> ExitCode:
    """`esail ensemble`. Cores are shared and a cluster is joined before JAX starts any computation."""
    check_ensemble(options)
    scene, names = scene_of(options), observable_names(options)
    if options.distributed:
        from esail_jax.commands.cluster import join_cluster

        join_cluster(options.coordinator, options.processes, options.process)
    else:
        from esail_jax.cores import share_cores

        share_cores(options.processes)
    from esail_jax.commands.ensemble import run_here, task_of

    task = task_of(
        scene, options.members, options.variations, options.seed, options.sampling, names, options.max_steps
    )
    if options.members > 1 and not options.variations and not options.quiet:
        print("Without --vary all members are equal.", file=sys.stderr)
    if options.distributed:
        from esail_jax.commands.cluster import run_distributed

        return run_distributed(task, options.output, options.resume, options.quiet)
    return run_here(task, options.output, options.processes, options.resume, options.quiet)


def bench(options: argparse.Namespace) -> ExitCode:
    """`esail bench`. It uses no cache of compiled programs, because it measures the compile time."""
    scene = scene_of(options)
    from esail_jax.commands.bench import NoReference, run_bench
    from esail_jax.compilation.stored import STORE

    STORE.switch_off()

    try:
        run_bench(scene, options.json)
    except NoReference as error:
        complain(error)
        return ExitCode.FAILED
    return ExitCode.DONE


def cache(options: argparse.Namespace) -> ExitCode:
    """`esail cache`."""
    from esail_jax.commands.cache import show_cache

    show_cache(options.clear)
    return ExitCode.DONE


def completion(options: argparse.Namespace) -> ExitCode:
    """`esail completion`."""
    from esail_jax.commands.completion import print_completion

    print_completion(options.shell)
    return ExitCode.DONE


COMMANDS = {
    "run": run, "scenes": scenes, "init": init, "info": info, "plot": plot, "export": export,
    "animate": animate, "view": view, "modes": modes, "ensemble": ensemble, "design": design,
    "bench": bench, "cache": cache, "completion": completion,
}  # fmt: skip


def complain(error: Exception | str) -> None:
    """Prints an error as one line on stderr."""
    print(" ".join(str(error).split()), file=sys.stderr)


def main(arguments: list[str] | None = None) -> ExitCode:
    """Runs a command line (None: that of the process). Returns the exit code. If the reader of the output
    has ended, so does the command, without a word."""
    try:
        try:
            return run_command(arguments)
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        with contextlib.suppress(OSError, ValueError):  # a stream that is no file
            # What is still in the buffer would fail again at the end of the process.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return ExitCode.CLOSED_PIPE
    except OSError as error:  # the rest of the output could not be written
        complain(error)
        return ExitCode.BAD_INPUT


def reader_has_ended() -> bool:
    """Tells whether the output goes to a pipe that nobody reads any more. Pipes of an ensemble between its
    processes may break, too."""
    if not hasattr(select, "poll"):
        return True
    poll = select.poll()
    poll.register(sys.stdout.fileno(), select.POLLOUT)
    return any(state & select.POLLERR for _, state in poll.poll(0))


def run_command(arguments: list[str] | None) -> ExitCode:
    """Runs a command line; errors are one line on stderr. Returns the exit code. Raises BrokenPipeError if
    the reader of the output has ended."""
    try:
        options = parser().parse_args(arguments)
        if options.command is None:
            raise UsageError("esail: COMMAND must be given (`esail --help` shows what there is)")
    except UsageError as error:
        complain(error)
        return ExitCode.BAD_INPUT
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return COMMANDS[options.command](options)
    except NoSpaceError as error:
        if "resume" not in options:
            complain(error)
            return ExitCode.BAD_INPUT
        complain(f"{error}; make room and use --resume")
        return ExitCode.INTERRUPTED
    except (InputError, OSError) as error:
        if isinstance(error, BrokenPipeError) and reader_has_ended():
            raise
        complain(sentence_of(error) if isinstance(error, OSError) else error)
        return ExitCode.BAD_INPUT
    except SimulationError as error:
        complain(error)
        return ExitCode.FAILED
    except KeyboardInterrupt:
        return ExitCode.INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
