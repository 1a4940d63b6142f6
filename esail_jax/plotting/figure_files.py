"""Files of figures: PNG, PDF and SVG."""

from collections.abc import Callable, Iterable
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imsave

DOTS_PER_INCH = 150
"""Resolution of the written figures."""


KINDS = ("png", "pdf", "svg")
"""Kinds of files."""

UNDATED = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}
"""What matplotlib leaves out of a file, so that the same figure gives the same bytes."""


Told = Callable[[Path], object] | None
"""A function that is called with the path of every file as soon as it is written; None for none."""


def write_figures(
    figures: Iterable[tuple[str, Figure]], directory: str | Path, tell: Told = None, kind: str = "png"
) -> list[Path]:
    """Writes every figure as DIRECTORY/<name>.<kind>, png, pdf or svg; returns the paths, and tells each of
    them at once.

    The directory is created if it does not exist. Raises OSError if that or the writing fails.
    """
    directory = Path(directory)
    directory.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, figure in figures:
        paths.append(directory / f"{name}.{kind}")
        write_once(figure, paths[-1], kind)
        if tell is not None:
            tell(paths[-1])
    return paths


def write_once(figure: Figure, path: Path, kind: str) -> None:
    """Writes a file: png, pdf or svg. A PNG file is the same as that of `figure.savefig`, which draws every
    figure twice."""
    if kind != "png":
        figure.savefig(path, format=kind, metadata=UNDATED[kind])
        return
    figure.set_dpi(DOTS_PER_INCH)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    imsave(path, canvas.buffer_rgba(), format="png", origin="upper", dpi=DOTS_PER_INCH)
