"""`esail info`."""

from collections.abc import Sequence
from pathlib import Path

from esail_jax.commands.description import describe
from esail_jax.files.opening import DESIGN, files_of, holds_ensemble
from esail_jax.scenes.loading import builtin_names


def print_info(paths: Sequence[Path]) -> None:
    """Prints what a path holds: a run, an ensemble, which may be unfinished, a design, or a scene. Several
    runs are a table, and several ensembles are one sample. Raises RunFileError, SceneError, and InputError
    for ensembles that do not fit together."""
    if len(paths) == 1 and paths[0].is_dir():
        print(folder_text(paths[0]))
        return
    if len(paths) == 1 and is_scene(paths[0]):
        print(scene_text(paths[0]))
        return
    files = files_of(paths)
    if all(holds_ensemble(file) for file in files):
        from esail_jax.commands.ensemble_report import describe_ensemble, describe_joined

        print(describe_joined(files) if len(files) > 1 else describe_ensemble(files[0]))
    elif len(files) > 1:
        from esail_jax.commands.side_by_side import describe_together

        print(describe_together(files))
    else:
        print(describe(files[0]))


def folder_text(folder: Path) -> str:
    """The description of a design or an ensemble by its folder. Raises RunFileError."""
    if (folder / DESIGN).exists():
        from esail_jax.commands.design_report import describe_design

        return describe_design(folder)
    from esail_jax.commands.ensemble_report import describe_folder

    return describe_folder(folder)


def is_scene(path: Path) -> bool:
    """Tells whether a path is that of a scene file, or the name of a built-in scene and no file."""
    return path.suffix == ".toml" or (not path.exists() and str(path) in builtin_names())


def scene_text(path: Path) -> str:
    """The description of a scene, which is checked but not run, and sentences on what in it may be meant
    otherwise. Raises SceneError."""
    from esail_jax.scenes.loading import read_scene
    from esail_jax.scenes.plausibility import doubts, without_effect

    scene = read_scene(path, {})
    cost = f"  cost      steps, time, memory and file size: esail run {path} --estimate"
    return "\n".join([f"{path}: {scene}", cost, *doubts(scene), *without_effect(scene)])
