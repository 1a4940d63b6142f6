"""The command `esail`: run, scenes, info, plot, ensemble, design, bench.

Exit status: 0 done; 2 bad input, one line on stderr, nothing written; 3 the solver gave up, the file
holds everything before; 130 interrupted, resumable.
"""

import argparse
import os
import signal
import sys
import threading
import tomllib
from pathlib import Path
from typing import Any

DONE, BAD_INPUT, GAVE_UP, INTERRUPTED = 0, 2, 3, 130


class UsageError(ValueError):
    """A command line that cannot be understood."""


class Parser(argparse.ArgumentParser):
    """Errors in one line."""

    def error(self, message: str):
        raise UsageError(f"{self.prog}: {message}")


def parser() -> Parser:
    """The command line."""
    top = Parser(prog="esail", description="Electric solar-wind sails, simulated.", allow_abbrev=False)
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    run = commands.add_parser("run", help="run a scene", allow_abbrev=False)
    of_scene(run)
    run.add_argument("-o", "--output", required=True, type=Path, metavar="RUN.h5")
    run.add_argument("--resume", action="store_true", help="continue RUN.h5 if it is there")
    run.add_argument("--quiet", action="store_true", help="no progress bar, no summary")
    commands.add_parser("scenes", help="list the built-in scenes", allow_abbrev=False)
    info = commands.add_parser("info", help="what was run, and how it ended", allow_abbrev=False)
    info.add_argument("run", type=Path, metavar="RUN.h5")
    plot = commands.add_parser("plot", help="draw figures of a run", allow_abbrev=False)
    plot.add_argument("run", type=Path, metavar="RUN.h5")
    plot.add_argument("-o", "--output", required=True, type=Path, metavar="DIR")
    design = commands.add_parser("design", help="gradient-based voltage design", allow_abbrev=False)
    of_scene(design)
    design.add_argument("-o", "--output", required=True, type=Path, metavar="DIR")
    design.add_argument("--objective", action="append", default=[], metavar="NAME=WEIGHT", dest="weights")
    design.add_argument("--iterations", type=int, default=30, metavar="N")
    design.add_argument("--method", choices=("lbfgs", "adam"), default="lbfgs")
    design.add_argument("--starts", type=int, default=1, metavar="N", help="begun from")
    design.add_argument("--seed", type=int, default=0, help="of the other starts")
    design.add_argument("--resume", action="store_true", help="go on with the design in DIR")
    design.add_argument("--quiet", action="store_true", help="no progress, no summary")
    ensemble = commands.add_parser("ensemble", help="many runs, numbers drawn", allow_abbrev=False)
    of_scene(ensemble)
    ensemble.add_argument("-o", "--output", required=True, type=Path, metavar="DIR")
    ensemble.add_argument("--members", type=int, required=True, metavar="N")
    ensemble.add_argument("--seed", type=int, default=0, metavar="K")
    ensemble.add_argument("--vary", action="append", default=[], metavar="KEY=DIST", dest="variations")
    ensemble.add_argument("--sampling", choices=("random", "sobol", "latin"), default="random")
    ensemble.add_argument("--observables", metavar="NAME,...", help="those to keep, all if not given")
    ensemble.add_argument("--processes", type=int, metavar="P", help="on this machine; one per core")
    ensemble.add_argument("--distributed", action="store_true", help="one of many processes of a cluster")
    ensemble.add_argument("--coordinator", metavar="HOST:PORT", help="of them, where JAX finds no cluster")
    ensemble.add_argument("--process", type=int, metavar="I", help="number of this one, likewise")
    ensemble.add_argument("--resume", action="store_true", help="compute what DIR lacks")
    ensemble.add_argument("--quiet", action="store_true", help="no progress, no summary")
    bench = commands.add_parser("bench", help="error against run time on this machine", allow_abbrev=False)
    bench.add_argument("--scene", default="baseline", help="a built-in scene or a TOML file")
    bench.add_argument("--t-end", metavar="SECONDS", help="end time in place of the scene's")
    bench.add_argument("--json", type=Path, metavar="FILE", help="write JSON lines")
    bench.set_defaults(settings=[])
    return top


def of_scene(command: argparse.ArgumentParser) -> None:
    """What every command that runs scenes takes."""
    command.add_argument("scene", help="a built-in scene or a TOML file")
    command.add_argument("--t-end", metavar="SECONDS", help="end time in place of the scene's")
    command.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="table.key=VALUE",
        dest="settings",
        help="value of a scene's key, in TOML or as plain text; may be repeated",
    )


def settings(options: argparse.Namespace) -> dict[str, Any]:
    """Overrides of `--set` and `--t-end`, by scene key."""
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
    """VALUE read as TOML; what does not parse is a string."""
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text.strip()
    return parsed["value"] if list(parsed) == ["value"] else text.strip()


def use_compilation_cache() -> None:
    """Keep compiled programs between runs, unless the user has decided on a place already."""
    import jax

    if jax.config.jax_compilation_cache_dir is None:
        base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
        jax.config.update("jax_compilation_cache_dir", os.path.join(base, "esail_jax"))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
        jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


def run(options: argparse.Namespace) -> int:
    """`esail run`."""
    from esail_jax.commands.run import run_scene
    from esail_jax.scenes.scene import load_scene

    use_compilation_cache()
    scene = load_scene(options.scene, settings(options))
    return run_scene(scene, options.output, options.resume, options.quiet)


def scenes(_: argparse.Namespace) -> int:
    """`esail scenes`."""
    from esail_jax.scenes.builtin_scenes import builtin_names, description

    for name in builtin_names():
        print(f"{name:15s} {description(name)}")
    return DONE


def info(options: argparse.Namespace) -> int:
    """`esail info`."""
    from esail_jax.commands.run import describe
    from esail_jax.files.run_file import holds_ensemble

    if holds_ensemble(options.run):
        from esail_jax.commands.ensemble_report import describe_ensemble

        print(describe_ensemble(options.run))
        return DONE
    print(describe(options.run))
    return DONE


def plot(options: argparse.Namespace) -> int:
    """`esail plot`."""
    from esail_jax.files.run_file import holds_ensemble, load
    from esail_jax.plotting import plot_all

    use_compilation_cache()
    if holds_ensemble(options.run):
        from esail_jax.ensembles.ensemble_file import load_ensemble
        from esail_jax.plotting.ensemble import plot_ensemble

        paths = plot_ensemble(load_ensemble(options.run), options.output)
    else:
        paths = plot_all(load(options.run), options.output)
    for path in paths:
        print(path)
    return DONE


def design(options: argparse.Namespace) -> int:
    """`esail design`."""
    from esail_jax.commands.design import design_scene
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
    names = ("iterations", "method", "starts", "seed", "resume", "quiet")
    chosen = {name: getattr(options, name) for name in names}
    scene = load_scene(options.scene, settings(options))
    found = design_scene(scene, options.output, weights, **chosen)
    from esail_jax.plotting.design import design_figure

    design_figure(*found).savefig(options.output / "design.png", dpi=110)
    return DONE


def ensemble(options: argparse.Namespace) -> int:
    """`esail ensemble`."""
    check_ensemble(options)
    use_compilation_cache()
    if options.distributed:
        join_cluster(options)
    else:
        from esail_jax.cores import share_cores

        share_cores(options.processes)
    from esail_jax.commands.ensemble import run_distributed, run_here, task_of
    from esail_jax.ensembles.sampling import VariationError, parse_variation
    from esail_jax.scenes.scene import load_scene

    scene = load_scene(options.scene, settings(options))
    names = None
    if options.observables is not None:
        names = [name.strip() for name in options.observables.split(",")]
    try:
        variations = [parse_variation(text) for text in options.variations]
        task = task_of(scene, options.members, variations, options.seed, options.sampling, names)
    except VariationError as error:
        raise UsageError(str(error)) from None
    if options.distributed:
        return run_distributed(task, options.output, options.resume, options.quiet)
    status = run_here(task, options.output, options.processes, options.resume, options.quiet)
    if status == DONE and not options.quiet:
        from esail_jax.commands.ensemble_report import describe_ensemble

        print(describe_ensemble(options.output / "ensemble.h5"))
    return status


def check_ensemble(options: argparse.Namespace) -> None:
    """Raise UsageError for numbers that cannot be."""
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
    """Become one of many processes: JAX finds SLURM, Open MPI and Kubernetes by itself."""
    import jax

    try:
        jax.distributed.initialize(options.coordinator, options.processes, options.process)
    except (ValueError, RuntimeError) as error:
        raise UsageError(f"`--distributed` must find the other processes, but does not: {error}") from None


def bench(options: argparse.Namespace) -> int:
    """`esail bench`: without the cache, so that compiling is timed."""
    from esail_jax.commands.bench import NoReference, run_bench
    from esail_jax.scenes.scene import load_scene

    scene = load_scene(options.scene, settings(options))
    try:
        run_bench(scene, options.json)
    except NoReference as error:
        complain(error)
        return GAVE_UP
    return DONE


COMMANDS = {
    "run": run, "scenes": scenes, "info": info, "plot": plot, "ensemble": ensemble, "design": design,
    "bench": bench,
}  # fmt: skip


def complain(error: Exception) -> None:
    """One line on stderr."""
    print(" ".join(str(error).split()), file=sys.stderr)


def main(arguments: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    try:
        options = parser().parse_args(arguments)
        from esail_jax.files.run_file import RunFileError
        from esail_jax.scenes.rules import SceneError
    except UsageError as error:
        complain(error)
        return BAD_INPUT
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return COMMANDS[options.command](options)
    except (UsageError, SceneError, RunFileError, OSError) as error:
        complain(error)
        return BAD_INPUT
    except KeyboardInterrupt:
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
