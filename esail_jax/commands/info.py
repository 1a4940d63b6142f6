"""`esail info`."""

from pathlib import Path

from esail_jax.commands.description import describe
from esail_jax.files.opening import holds_ensemble


def print_info(path: Path) -> None:
    """Prints what a run file or the file of an ensemble holds. Raises RunFileError."""
    if holds_ensemble(path):
        from esail_jax.commands.ensemble_report import describe_ensemble

        print(describe_ensemble(path))
    else:
        print(describe(path))
