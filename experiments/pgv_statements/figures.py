"""The figures and tables of [PGV] Sec. 4, App. C and D, and where ours are."""

from typing import NamedTuple


class Figure(NamedTuple):
    """A figure or table of the paper: its number, what it shows, our file relative to this folder (empty:
    none), and the command."""

    number: str
    what: str
    file: str
    command: str


def ours(number: int, what: str, folder: str) -> Figure:
    """The entry of a figure in one of the folders of this study."""
    file = f"../{folder}/figures/fig-{number:02d}.png"
    return Figure(f"Fig. {number}", what, file, f"python experiments/{folder}/run.py")


FIGURES = (
    Figure(
        "Table 1",
        "data of the baseline: the built-in scene",
        "../../esail_jax/scenes/builtin/baseline.toml",
        "esail init baseline",
    ),
    ours(4, "convergence: thrust, strain, run time", "pgv_convergence"),
    ours(5, "convergence: angular rates", "pgv_convergence"),
    Figure("Table 2", "frequencies, below", "", "python experiments/pgv_statements/table2.py"),
    ours(6, "motion of tether 1", "pgv_baseline"),
    ours(7, "forces on tether 1", "pgv_baseline"),
    ours(8, "energies", "pgv_baseline"),
    ours(9, "forces on the sail", "pgv_baseline"),
    ours(10, "angular rates and attitude", "pgv_baseline"),
    ours(11, "cables and trusses: motion", "pgv_truss"),
    ours(12, "cables and trusses: forces", "pgv_truss"),
    Figure(
        "App. D",
        "motion at 0.01 deg: the built-in scene",
        "",
        "esail run appendix-d -o d.h5; esail animate d.h5 -o d.webp",
    ),
)
