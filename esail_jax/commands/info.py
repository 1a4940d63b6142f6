"""`esail info`."""

from collections.abc import Sequence
from pathlib import Path

from esail_jax.commands.description import describe
from esail_jax.files.opening import holds_ensemble


def print_info(paths: Sequence[Path]) -> None:
    """Prints what a run file, or the file or the folder of an ensemble holds, or a table of several run
    files. Raises RunFileError."""
    if len(paths) > 1:
        from esail_jax.commands.side_by_side import describe_together

        print(describe_together(paths))
    elif paths[0].is_dir() or holds_ensemble(paths[0]):
        from esail_jax.commands.ensemble_report import describe_ensemble, describe_folder

        print(describe_folder(paths[0]) if paths[0].is_dir() else describe_ensemble(paths[0]))
    else:
        print(describe(paths[0]))
