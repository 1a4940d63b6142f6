"""`esail info`: what a path holds, a run, an ensemble, a design, a scene or a measured wind."""

import argparse
from pathlib import Path
from typing import Any

from esail_jax.commands.command_line import ExitCode, UsageError, add_command, refuse_existing


def add(commands: Any) -> None:
    """Adds `esail info`."""
    info = add_command(
        commands, "info", "print model, method, status, speed and accuracy of a run or an ensemble"
    )
    info.add_argument(
        "runs", type=Path, nargs="+", metavar="RUN.h5",
        help="run file, or the folder of an ensemble or a design, also of one that is not finished; "
        "several runs make a table, also of the keys in which their scenes differ; several ensembles are "
        "one sample; a scene, built-in or a file (.toml), is checked and described; of wind "
        "files (CSV, OMNI, CDF) span, gaps and distribution",
    )  # fmt: skip
    info.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="figure of wind files: .png, .pdf or .svg"
    )
    info.add_argument("--overwrite", action="store_true", help="replace the figure if it exists")


def run(options: argparse.Namespace) -> ExitCode:
    """Prints what the paths hold: a run, an ensemble, which may be unfinished, a design, a scene, or a
    measured wind, which is drawn as well if there is a file for it. Several runs are a table, and several
    ensembles or wind files are one. Raises RunFileError, SceneError, UsageError, and InputError for
    ensembles that do not fit together."""
    from esail_jax.wind_files.opening import is_wind_file

    if all(is_wind_file(path) for path in options.runs):
        describe_wind(options)
        return ExitCode.DONE
    if options.output is not None:
        raise UsageError("`-o` must be left out unless all files are those of a wind, but is given")
    print(text_of(options.runs))
    return ExitCode.DONE


def describe_wind(options: argparse.Namespace) -> None:
    """Prints the description of wind files as one wind, and draws it if a file for the figure is given.
    Raises SceneError and UsageError."""
    from esail_jax.wind_files.summary import read_wind, summary_of

    names = ", ".join(map(str, options.runs))
    if options.output is None:
        print(summary_of(read_wind(options.runs), names))
        return
    from esail_jax.atomic_file import atomic_file
    from esail_jax.plotting.figure_files import KINDS, write_once
    from esail_jax.plotting.wind import draw_wind

    kind = options.output.suffix[1:].lower()
    if kind not in KINDS:
        raise UsageError(f"`-o` must end in .png, .pdf or .svg, but ends in {options.output.suffix!r}")
    refuse_existing(options.output, options.overwrite)
    wind = read_wind(options.runs)
    figure = draw_wind(wind, ", ".join(path.name for path in options.runs))
    with atomic_file(options.output) as part:
        write_once(figure, part, kind)
    print(summary_of(wind, names))
    print(options.output)


def text_of(paths: list[Path]) -> str:
    """The text that `run` prints, of all but wind files."""
    from esail_jax.commands import reports
    from esail_jax.files.opening import files_of, holds_ensemble

    if len(paths) == 1 and paths[0].is_dir():
        return folder_text(paths[0])
    if len(paths) == 1 and is_scene(paths[0]):
        return scene_text(paths[0])
    files = files_of(paths)
    if all(holds_ensemble(file) for file in files):
        from esail_jax.commands.ensemble_report import describe_ensemble, describe_joined

        return describe_joined(files) if len(files) > 1 else describe_ensemble(files[0])
    return reports.describe_together(files) if len(files) > 1 else reports.describe(files[0])


def folder_text(folder: Path) -> str:
    """The description of a design or an ensemble by its folder. Raises RunFileError."""
    from esail_jax.files.opening import DESIGN

    if (folder / DESIGN).exists():
        from esail_jax.commands.reports import describe_design

        return describe_design(folder)
    from esail_jax.commands.ensemble_report import describe_folder

    return describe_folder(folder)


def is_scene(path: Path) -> bool:
    """Tells whether a path is that of a scene file, or the name of a built-in scene and no file."""
    from esail_jax.scenes.loading import builtin_names

    return path.suffix == ".toml" or (not path.exists() and str(path) in builtin_names())


def scene_text(path: Path) -> str:
    """The description of a scene, which is checked but not run, and sentences on what in it may be meant
    otherwise. Raises SceneError."""
    from esail_jax.scenes.loading import read_scene
    from esail_jax.scenes.plausibility import doubts, without_effect

    scene = read_scene(path, {})
    cost = f"  cost      steps, time, memory and file size: esail run {path} --estimate"
    return "\n".join([f"{path}: {scene}", cost, *doubts(scene), *without_effect(scene)])
