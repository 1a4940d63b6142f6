"""The command `esail`: run, scenes, info, plot, ensemble, design, bench.

Exit codes are those of `commands/exit_codes.py`. Errors are one line on stderr.
"""

import argparse
import os
import signal
import sys
import threading
import tomllib
from pathlib import Path
from typing import Any

from esail_jax.commands.exit_codes import ExitCode

OBJECTIVES_HELP = (
    "mean-torque, attitude, final-attitude, hub-swing, lagging, coning, spin, hub-torque, power and "
    "closeness are made small; of thrust at least 96 %% is retained; spin-plane:A or spin-plane:A,P or "
    "spin-plane:A,P,T turns the spin plane to a sailing angle A and a precession angle P [deg], at the end "
    "or in the mean over the last T seconds"
)
"""Objectives of `esail design`, as in `design/objectives.py`."""


class UsageError(ValueError):
    """A command line that cannot be understood."""


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def error(self, message: str):
        raise UsageError(f"{self.prog}: {message}")


def parser() -> Parser:
    """The parser of the command line."""
    top = Parser(
        prog="esail",
        description="Simulates electric solar-wind sails and tethered satellites.",
        epilog="Exit codes: 0 done; 2 bad input (one line on stderr, nothing written); 3 the solver failed "
        "(the file holds everything before the failure); 130 interrupted (--resume continues).",
        allow_abbrev=False,
    )
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for add in (add_run, add_scenes, add_info, add_plot, add_design, add_ensemble, add_bench):
        add(commands)
    return top


def add_command(commands: Any, name: str, text: str) -> argparse.ArgumentParser:
    """A parser of one command. text: its help."""
    return commands.add_parser(
        name, help=text, description=f"{text[0].upper()}{text[1:]}.", allow_abbrev=False
    )


def add_scene(command: argparse.ArgumentParser) -> None:
    """Adds the arguments of every command that simulates a given scene."""
    command.add_argument("scene", help="name of a built-in scene, or path of a TOML file")
    command.add_argument("--t-end", metavar="SECONDS", help="end time [s] instead of the scene's")
    command.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="table.key=VALUE",
        dest="settings",
        help="value of a scene key instead of the scene's, in TOML; may be given several times",
    )


def add_run(commands: Any) -> None:
    """Adds `esail run`."""
    run = add_command(commands, "run", "simulate a scene and write its run file")
    add_scene(run)
    run.add_argument(
        "-o", "--output", required=True, type=Path, metavar="RUN.h5", help="run file to write (HDF5)"
    )
    run.add_argument(
        "--resume", action="store_true", help="continue RUN.h5 from its last checkpoint, if it exists"
    )
    run.add_argument("--quiet", action="store_true", help="print no progress bar and no summary")


def add_scenes(commands: Any) -> None:
    """Adds `esail scenes`."""
    add_command(commands, "scenes", "list the built-in scenes")


def add_info(commands: Any) -> None:
    """Adds `esail info`."""
    info = add_command(
        commands, "info", "print model, method, status, speed and accuracy of a run or an ensemble"
    )
    info.add_argument("run", type=Path, metavar="RUN.h5", help="run file, or ensemble.h5 of an ensemble")


def add_plot(commands: Any) -> None:
    """Adds `esail plot`."""
    plot = add_command(commands, "plot", "draw the figures of a run or an ensemble")
    plot.add_argument("run", type=Path, metavar="RUN.h5", help="run file, or ensemble.h5 of an ensemble")
    plot.add_argument(
        "-o", "--output", required=True, type=Path, metavar="DIR", help="folder for the PNG files"
    )


def add_design(commands: Any) -> None:
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
        f"Every objective is divided by its value at constant voltage: {OBJECTIVES_HELP}",
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


def add_ensemble(commands: Any) -> None:
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
        help="scene key and its distribution, in the units of the scene: uniform:a:b, normal:mean:sd or "
        "grid:a:b:n (n equidistant numbers; several grids form all combinations). KEY= draws one number "
        "for a member, KEY[*]= one for each of its tethers or rods. May be given several times",
    )  # fmt: skip
    ensemble.add_argument(
        "--sampling", choices=("random", "sobol", "latin"), default="random",
        help="independent draws, a scrambled Sobol sequence, or a Latin hypercube (default: %(default)s)",
    )  # fmt: skip
    ensemble.add_argument(
        "--observables", metavar="NAME,...", help="observables to write to the file (default: all)"
    )
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


def add_bench(commands: Any) -> None:
    """Adds `esail bench`."""
    bench = add_command(
        commands, "bench", "measure error and run time of the methods of integration on this machine"
    )
    bench.add_argument(
        "--scene", default="baseline", metavar="SCENE",
        help="name of a built-in scene, or path of a TOML file (default: %(default)s)",
    )  # fmt: skip
    bench.add_argument("--t-end", metavar="SECONDS", help="end time [s] instead of the scene's")
    bench.add_argument("--json", type=Path, metavar="FILE", help="also write the results as JSON lines")
    bench.set_defaults(settings=[])


def settings(options: argparse.Namespace) -> dict[str, Any]:
    """Overrides from `--set` and `--t-end`, by scene key."""
    found = {}
    for text in options.settings:
        key, equals, value = text.partition("=")
        if not equals or "." not in key:
            raise UsageError(f"`--set` must look like table.key=VALUE, but is {text!r}")
        found[key.strip()] = toml_or_text(value)
    if options.t_end is not None:
        found["integrator.t_end"] = toml_or_text(options.t_end)
    return found


def toml_or_text(text: str) -> Any:
    """The value of a TOML text, or the text itself if it is no TOML."""
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text.strip()
    return parsed["value"] if list(parsed) == ["value"] else text.strip()


def use_compilation_cache() -> None:
    """Keeps compiled programs between runs in the user's cache folder, unless JAX already has a folder."""
    import jax

    if jax.config.jax_compilation_cache_dir is None:
        base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
        jax.config.update("jax_compilation_cache_dir", os.path.join(base, "esail_jax"))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
        jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


def run(options: argparse.Namespace) -> ExitCode:
    """`esail run`."""
    from esail_jax.commands.run import run_scene
    from esail_jax.scenes.scene import load_scene

    use_compilation_cache()
    scene = load_scene(options.scene, settings(options))
    return run_scene(scene, options.output, options.resume, options.quiet)


def scenes(_: argparse.Namespace) -> ExitCode:
    """`esail scenes`."""
    from esail_jax.scenes.builtin_scenes import builtin_names, description

    for name in builtin_names():
        print(f"{name:15s} {description(name)}")
    return ExitCode.DONE


def info(options: argparse.Namespace) -> ExitCode:
    """`esail info`."""
    from esail_jax.commands.run import describe
    from esail_jax.files.run_file import holds_ensemble

    if holds_ensemble(options.run):
        from esail_jax.commands.ensemble_report import describe_ensemble

        print(describe_ensemble(options.run))
        return ExitCode.DONE
    print(describe(options.run))
    return ExitCode.DONE


def plot(options: argparse.Namespace) -> ExitCode:
    """`esail plot`."""
    from esail_jax.files.run_file import holds_ensemble, load
    from esail_jax.plotting import plot_all

    use_compilation_cache()
    if holds_ensemble(options.run):
        from esail_jax.ensembles import load_ensemble
        from esail_jax.plotting.ensemble import plot_ensemble

        paths = plot_ensemble(load_ensemble(options.run), options.output)
    else:
        paths = plot_all(load(options.run), options.output)
    for path in paths:
        print(path)
    return ExitCode.DONE


def design(options: argparse.Namespace) -> ExitCode:
    """`esail design`."""
    from esail_jax.commands.design import Optimisation, run_design
    from esail_jax.scenes.scene import load_scene

    for name in ("iterations", "starts"):
        if getattr(options, name) < 1:
            raise UsageError(f"`--{name}` must be positive, but is {getattr(options, name)}")
    weights = {}
    for text in options.weights:
        name, equals, weight = text.partition("=")
        value = toml_or_text(weight)
        if not equals or isinstance(value, bool) or not isinstance(value, (int, float)):
            raise UsageError(f"`--objective` must look like NAME=WEIGHT, but is {text!r}")
        weights[name.strip()] = float(value)
    use_compilation_cache()
    how = Optimisation(options.iterations, options.method, options.starts, options.seed)
    scene = load_scene(options.scene, settings(options))
    found = run_design(scene, options.output, weights, how, options.resume, options.quiet)
    from esail_jax.plotting.design import design_figure

    design_figure(*found).savefig(options.output / "design.png", dpi=110)
    return ExitCode.DONE


def ensemble(options: argparse.Namespace) -> ExitCode:
    """`esail ensemble`."""
    check_ensemble(options)
    use_compilation_cache()
    if options.distributed:
        join_cluster(options)
    else:
        from esail_jax.cores import share_cores

        share_cores(options.processes)
    from esail_jax.commands.ensemble import run_distributed, run_here, task_of
    from esail_jax.scenes.scene import load_scene

    scene = load_scene(options.scene, settings(options))
    names = None
    if options.observables is not None:
        names = [name.strip() for name in options.observables.split(",")]
    task = task_of(scene, options.members, options.variations, options.seed, options.sampling, names)
    if options.distributed:
        return run_distributed(task, options.output, options.resume, options.quiet)
    status = run_here(task, options.output, options.processes, options.resume, options.quiet)
    if status == ExitCode.DONE and not options.quiet:
        from esail_jax.commands.ensemble_report import describe_ensemble

        print(describe_ensemble(options.output / "ensemble.h5"))
    return status


def check_ensemble(options: argparse.Namespace) -> None:
    """Raises UsageError for options of `esail ensemble` that are out of range or do not fit together."""
    for name, least in (("members", 1), ("seed", 0), ("processes", 1), ("process", 0)):
        value = getattr(options, name)
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


def join_cluster(options: argparse.Namespace) -> None:
    """Makes this process one of many. JAX recognises SLURM, Open MPI and Kubernetes by itself."""
    import jax

    try:
        jax.distributed.initialize(options.coordinator, options.processes, options.process)
    except (ValueError, RuntimeError) as error:
        raise UsageError(f"`--distributed` must find the other processes, but does not: {error}") from None


def bench(options: argparse.Namespace) -> ExitCode:
    """`esail bench`. It uses no cache of compiled programs, because it measures the compile time."""
    from esail_jax.commands.bench import NoReference, run_bench
    from esail_jax.scenes.scene import load_scene

    scene = load_scene(options.scene, settings(options))
    try:
        run_bench(scene, options.json)
    except NoReference as error:
        complain(error)
        return ExitCode.FAILED
    return ExitCode.DONE


COMMANDS = {
    "run": run, "scenes": scenes, "info": info, "plot": plot, "ensemble": ensemble, "design": design,
    "bench": bench,
}  # fmt: skip


def complain(error: Exception) -> None:
    """Prints an error as one line on stderr."""
    print(" ".join(str(error).split()), file=sys.stderr)


def main(arguments: list[str] | None = None) -> ExitCode:
    """Runs a command line (None: that of the process). Returns the exit code."""
    try:
        options = parser().parse_args(arguments)
    except UsageError as error:
        complain(error)
        return ExitCode.BAD_INPUT
    from esail_jax import RunFileError, SceneError, SimulationError

    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return COMMANDS[options.command](options)
    except (UsageError, SceneError, RunFileError, OSError) as error:
        complain(error)
        return ExitCode.BAD_INPUT
    except SimulationError as error:
        complain(error)
        return ExitCode.FAILED
    except KeyboardInterrupt:
        return ExitCode.INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
