"""What [PGV] leaves open in Sec. 4.3.2 and 5, judged by runs over 300 spin periods (`pgv_long_runs`)."""

import csv
from pathlib import Path

from judged import FAILS, HOLDS, IN_PART, Verdict, statement

FOLDER = Path(__file__).parents[1] / "pgv_long_runs"


def table(name: str, *keys: str) -> dict:
    """The rows of a table of the long runs by the values of these columns."""
    with open(FOLDER / name, encoding="utf-8") as file:
        return {tuple(row[key] for key in keys): row for row in csv.DictReader(file)}


@statement(
    "4.3.2", "Fig. 10(a1)", "The growth of the spin oscillation may be an instability or a slow mode."
)
def spin_growth(runs):
    row = table("long.csv", "run", "signal")["long-alpha-0", "range of the spin rate [mrad/s]"]
    what = "long-alpha-0: spin periods from one minimum of the oscillation to the next"
    beat = table("lines.csv", "quantity")[(what,)]
    first, last = float(row["first 50"]), float(row["last 50"])
    return Verdict(
        IN_PART if abs(last / first - 1.0) < 0.05 else FAILS,
        "neither an instability nor one mode: two modes beat, with a period of "
        f"{float(beat['measured']):.1f} T_s. "
        f"Largest range in the first 50 periods {first:.3f} mrad/s, in the last 50 of 300 {last:.3f} "
        "mrad/s",
    )


@statement("5", "Fig. 6(b1)", "Lagging has a growing tendency (left open: whether it goes on).")
def lagging_growth(runs):
    row = table("long.csv", "run", "signal")["long-alpha-10", "largest lagging angle [deg]"]
    lines = table("lines.csv", "quantity")
    turning = [
        1.0 / abs(float(lines[f"10 deg: slow line of lagging, {way} the spin",]["measured"]))
        for way in ("with", "against")
    ]
    first, last = float(row["first 50"]), float(row["last 50"])
    return Verdict(
        FAILS if last < 1.05 * first else HOLDS,
        "at 10 deg it is a slow oscillation of the hub against the tethers, with periods of "
        f"{turning[0]:.1f} and "
        f"{turning[1]:.1f} T_s: largest angle of all tethers {first:.2f} deg in the "
        "first 50 "
        f"periods, {last:.2f} deg in the last 50 of 300",
    )


@statement(
    "4.3.2", "Fig. 10(a2, a3)", "The growth of the other two rates at 10 deg may indicate an instability."
)
def tilt_growth(runs):
    lines = table("lines.csv", "quantity")
    what = "{}: growth of the other rates per spin period, 700 to 1000"
    small, large = (
        float(lines[what.format(name),]["measured"]) for name in ("longest-alpha-0.01", "longest-alpha-10")
    )
    return Verdict(
        HOLDS if small > 0.005 else FAILS,
        "the growth of the first three periods is beating, but a slow instability follows: from 0.01 deg "
        f"they grow e-fold in {1.0 / small:.0f} T_s until the end of 1000 periods. At 10 deg they stop "
        f"growing after 600 periods ({large:+.1e} per period at the end)",
    )
