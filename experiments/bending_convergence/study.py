"""Defines the runs of the study."""

from models import Lane, Run, run

CABLES = (1, 2, 3, 5, 7, 9, 10, 15, 20)
TRUSSES = (1, 2, 3, 5, 7, 9, 10, 11, 15, 20, 40, 80, 160)
FINE, FINEST = 40, 80
"""Numbers of cables of the references: for stiffer tethers, and for the tethers of the scene."""

DAMPED = Lane()
AXIAL = (Lane(axial=0.0), DAMPED, Lane(axial=10.0))
AS_SHIPPED = Lane(bending=1.0)
"""Parameters of the scene itself, with bending damping; the other runs have none."""

POWERS = (2, 4, 6, 8, 10, 11, 12, 13, 14)
"""Exponents k of the factors 10^k of EI."""

SWEPT = (5, 20, FINE)
"""Numbers of cables that run with all these factors."""

SAIL = (("nonlinear", 5), *(("none", n) for n in (1, 3, 5, 15)), *(("truss", n) for n in (1, 3, 5, 9, 20)))
"""Meshes of the published sail of 12 tethers; the finest cable is the reference."""


def stiffer(*powers: int) -> tuple[Lane, ...]:
    """The parameters of tethers with 10^power times the EI."""
    return tuple(Lane(stiffness=10.0**power) for power in powers)


def lanes(variant: str, n: int) -> tuple[Lane, ...]:
    """The parameters with which a mesh is run."""
    if n >= FINEST:
        return AXIAL if variant == "nonlinear" else (DAMPED,)
    if variant == "nonlinear":
        return (*AXIAL, AS_SHIPPED, *stiffer(*(POWERS if n in SWEPT else (10, 12, 14))))
    if variant == "linear":
        return (DAMPED, *(stiffer(8, 10, 12, 13) if n in SWEPT else ()))
    return AXIAL


def runs_of_one_tether(tell=print) -> list[Run]:
    """Makes all runs of one tether."""
    plan = [(variant, n, 1) for variant in ("nonlinear", "linear", "none") for n in (*CABLES, FINE)]
    plan += [("truss", n, 1) for n in TRUSSES] + [("nonlinear", FINEST, 1)]
    plan += [("nonlinear", FINE, 2), ("nonlinear", 5, 2), ("truss", 9, 2)]
    found = []
    for variant, n, refine in plan:
        found += run(variant, n, lanes(variant, n) if refine == 1 else (DAMPED,), refine)
        tell(f"{variant:9s} {n:3d}  {found[-1].microseconds:6.1f} us per step", flush=True)
    return found


def runs_of_the_sail(tell=print) -> list[Run]:
    """Makes all runs of the sail."""
    found = []
    for variant, n in SAIL:
        lane = AS_SHIPPED if variant == "nonlinear" else DAMPED
        found += run(variant, n, (lane,), scene="baseline")
        tell(f"sail {variant:9s} {n:3d}  {found[-1].microseconds:6.1f} us per step", flush=True)
    return found
