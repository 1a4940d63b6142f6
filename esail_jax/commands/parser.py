"""The parser of the command line, with the help of every command."""

from pathlib import Path
from typing import Any

from esail_jax.commands.arguments import Parser, ShowVersion, add_command, add_looks, add_scene

OBJECTIVES_HELP = (
    "mean-torque, attitude, final-attitude, hub-swing, lagging, coning, spin, hub-torque, power and "
    "closeness are made small; of thrust at least 96 %% is retained; spin-plane:A or spin-plane:A,P or "
    "spin-plane:A,P,T turns the spin plane to a sailing angle A and a precession angle P [deg], at the end "
    "or in the mean over the last T seconds"
)
"""Objectives of `esail design`, as in `design/objectives.py`."""

SHELLS = ("bash", "zsh", "fish")
"""Shells for which `esail completion` writes a script."""


def parser() -> Parser:
    """The parser of the command line."""
    top = Parser(
        prog="esail",
        description="Simulates electric solar-wind sails and tethered satellites.",
        epilog="Exit codes: 0 done; 2 bad input (one line on stderr, nothing written); 3 the solver failed "
        "(the file holds everything before the failure); 130 interrupted (--resume continues); "
        "141 the reader of the output has ended.",
        allow_abbrev=False,
    )
    top.add_argument("--version", action=ShowVersion, nargs=0, help="show the version and exit")
    commands = top.add_subparsers(dest="command", metavar="COMMAND")
    for add in (
        add_run, add_scenes, add_init, add_info, add_plot, add_export, add_animate, add_view, add_modes,
        add_design, add_ensemble, add_bench, add_cache, add_completion,
    ):  # fmt: skip
        add(commands)
    return top


def add_run(commands: Any) -> None:
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


def add_scenes(commands: Any) -> None:
    """Adds `esail scenes`."""
    add_command(commands, "scenes", "list the built-in scenes")


def add_init(commands: Any) -> None:
    """Adds `esail init`."""
    init = add_command(
        commands, "init", "write a built-in scene with a comment on every key, to start from"
    )
    init.add_argument("name", metavar="NAME", help="name of a built-in scene")
    init.add_argument(
        "-o", "--output", type=Path, metavar="FILE.toml", help="file to write (default: standard output)"
    )


def add_info(commands: Any) -> None:
    """Adds `esail info`."""
    info = add_command(
        commands, "info", "print model, method, status, speed and accuracy of a run or an ensemble"
    )
    info.add_argument(
        "runs", type=Path, nargs="+", metavar="RUN.h5",
        help="run file, or the folder of an ensemble or a design, also of one that is not finished; "
        "several runs make a table, also of the keys in which their scenes differ; several ensembles are "
        "one sample; a scene, built-in or a file (.toml), is checked and described",
    )  # fmt: skip


def add_plot(commands: Any) -> None:
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


def add_export(commands: Any) -> None:
    """Adds `esail export`."""
    export = add_command(commands, "export", "write the observables of a run as a table for other programs")
    export.add_argument("run", type=Path, metavar="RUN.h5", help="run file")
    export.add_argument(
        "-o", "--output", required=True, type=Path, metavar="FILE",
        help="file to write: .csv (comma-separated values) or .nc (netCDF; needs xarray)",
    )  # fmt: skip
    export.add_argument("--overwrite", action="store_true", help="replace the file if it exists")


def add_animate(commands: Any) -> None:
    """Adds `esail animate`."""
    animate = add_command(commands, "animate", "draw a run as a moving picture")
    animate.add_argument("run", type=Path, metavar="RUN.h5", help="run file, or ensemble.h5 with --member")
    animate.add_argument(
        "-o",
        "--output",
        required=True,
        type=Path,
        metavar="FILE",
        help="file to write: .webp, .gif or .mp4",
    )
    add_looks(animate)
    animate.add_argument(
        "--seconds", type=float, default=6.0, help="duration of the whole run (default: %(default)g)"
    )
    animate.add_argument(
        "--fps", type=float, default=15.0, help="pictures per second, at most (default: %(default)g)"
    )
    animate.add_argument(
        "--size", default="560x480", metavar="WIDTHxHEIGHT", help="in pixels (default: %(default)s)"
    )


def add_view(commands: Any) -> None:
    """Adds `esail view`."""
    view = add_command(
        commands,
        "view",
        "write a page for a browser that shows runs in motion, side by side, without network",
    )
    view.add_argument(
        "runs", type=Path, nargs="+", metavar="RUN.h5", help="run files, or ensemble.h5 with --member"
    )
    view.add_argument("-o", "--output", required=True, type=Path, metavar="FILE.html", help="page to write")
    add_looks(view)


def add_modes(commands: Any) -> None:
    """Adds `esail modes`."""
    modes = add_command(
        commands, "modes", "frequencies, damping and names of a sail's modes about its spinning equilibrium"
    )
    add_scene(modes)
    modes.add_argument("--json", type=Path, metavar="FILE", help="also write all modes as a JSON list")
    modes.add_argument("-o", "--output", type=Path, metavar="DIR", help="folder for figures of the shapes")
    modes.add_argument(
        "--count", type=int, metavar="N",
        help="number of modes, those of the lowest frequencies; a line of the table may "
        "hold several (default: all; of large sails with unequal "
        "tethers the lowest 100)",
    )  # fmt: skip
    modes.add_argument(
        "--floquet", action="store_true",
        help="also find the periodic orbit at the sailing angle and its multipliers (minutes)",
    )  # fmt: skip


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


def add_cache(commands: Any) -> None:
    """Adds `esail cache`."""
    cache = add_command(commands, "cache", "show where compiled programs are kept, and their size")
    cache.add_argument("--clear", action="store_true", help="remove them; they are compiled again")


def add_completion(commands: Any) -> None:
    """Adds `esail completion`."""
    completion = add_command(
        commands,
        "completion",
        'print a script with which a shell completes command lines: eval "$(esail completion bash)"',
    )
    completion.add_argument("shell", choices=SHELLS, help="shell that reads the script")
