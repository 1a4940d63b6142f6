"""The command `esail`: run, scenes, info, plot, design, bench.

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
    run.add_argument("scene", help="a built-in scene or a TOML file")
    run.add_argument("-o", "--output", required=True, type=Path, metavar="RUN.h5")
    run.add_argument("--t-end", metavar="SECONDS", help="end time in place of the scene's")
    run.add_argument("--set", action="append", default=[], metavar="table.key=VALUE", dest="settings")
    run.add_argument("--resume", action="store_true", help="continue RUN.h5 if it is there")
    run.add_argument("--quiet", action="store_true", help="no progress bar, no summary")
    commands.add_parser("scenes", help="list the built-in scenes", allow_abbrev=False)
    info = commands.add_parser("info", help="what was run, and how it ended", allow_abbrev=False)
    info.add_argument("run", type=Path, metavar="RUN.h5")
    plot = commands.add_parser("plot", help="draw figures of a run", allow_abbrev=False)
    plot.add_argument("run", type=Path, metavar="RUN.h5")
    plot.add_argument("-o", "--output", required=True, type=Path, metavar="DIR")
    design = commands.add_parser("design", help="gradient-based voltage design", allow_abbrev=False)
    design.add_argument("scene", help="a built-in scene or a TOML file")
    design.add_argument("-o", "--output", required=True, type=Path, metavar="DIR")
    design.add_argument("--t-end", metavar="SECONDS", help="end time in place of the scene's")
    design.add_argument("--set", action="append", default=[], metavar="table.key=VALUE", dest="settings")
    design.add_argument("--objective", action="append", default=[], metavar="NAME=WEIGHT", dest="weights")
    design.add_argument("--iterations", type=int, default=30, metavar="N")
    design.add_argument("--method", choices=("lbfgs", "adam"), default="lbfgs")
    design.add_argument("--starts", type=int, default=1, metavar="N", help="begun from at once")
    design.add_argument("--seed", type=int, default=0, help="of the other starts")
    design.add_argument("--resume", action="store_true", help="go on with the design in DIR")
    design.add_argument("--quiet", action="store_true", help="no progress, no summary")
    bench = commands.add_parser("bench", help="error against run time on this machine", allow_abbrev=False)
    bench.add_argument("--scene", default="baseline", help="a built-in scene or a TOML file")
    bench.add_argument("--t-end", metavar="SECONDS", help="end time in place of the scene's")
    bench.add_argument("--json", type=Path, metavar="FILE", help="write JSON lines")
    bench.set_defaults(settings=[])
    return top


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
    from esail_jax.runner import run_scene
    from esail_jax.scenes.scene import load_scene

    use_compilation_cache()
    scene = load_scene(options.scene, settings(options))
    return run_scene(scene, options.output, options.resume, options.quiet)


def scenes(_: argparse.Namespace) -> int:
    """`esail scenes`."""
    from esail_jax.scenes.presets import builtin_names, description

    for name in builtin_names():
        print(f"{name:15s} {description(name)}")
    return DONE


def info(options: argparse.Namespace) -> int:
    """`esail info`."""
    from esail_jax.runner import describe

    print(describe(options.run))
    return DONE


def plot(options: argparse.Namespace) -> int:
    """`esail plot`."""
    from esail_jax.plotting import plot_all
    from esail_jax.storage import load

    use_compilation_cache()
    for path in plot_all(load(options.run), options.output):
        print(path)
    return DONE


def design(options: argparse.Namespace) -> int:
    """`esail design`."""
    from esail_jax.design_run import design_scene
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


def bench(options: argparse.Namespace) -> int:
    """`esail bench`: without the cache, so that compiling is timed."""
    from esail_jax.bench import NoReference, run_bench
    from esail_jax.scenes.scene import load_scene

    scene = load_scene(options.scene, settings(options))
    try:
        run_bench(scene, options.json)
    except NoReference as error:
        complain(error)
        return GAVE_UP
    return DONE


COMMANDS = {"run": run, "scenes": scenes, "info": info, "plot": plot, "design": design, "bench": bench}


def complain(error: Exception) -> None:
    """One line on stderr."""
    print(" ".join(str(error).split()), file=sys.stderr)


def main(arguments: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    try:
        options = parser().parse_args(arguments)
        from esail_jax.scenes.keys import SceneError
        from esail_jax.storage import RunFileError
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
