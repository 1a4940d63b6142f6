"""PNG files of figures."""

from collections.abc import Iterable
from pathlib import Path

from matplotlib.figure import Figure

DOTS_PER_INCH = 150
"""Resolution of the written figures."""


def write_figures(figures: Iterable[tuple[str, Figure]], directory: str | Path) -> list[Path]:
    """Writes every figure as DIRECTORY/<name>.png; returns the paths.

    The directory is created if it does not exist. Raises OSError if that or the writing fails.
    """
    directory = Path(directory)
    directory.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, figure in figures:
        paths.append(directory / f"{name}.png")
        figure.savefig(paths[-1], dpi=DOTS_PER_INCH)
    return paths
