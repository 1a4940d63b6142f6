"""Makes two tables of the README from CSV files: error against time, and time per acceleration.

python experiments/mw_rods/tables.py    # rewrites the text between the markers in README.md
"""

import re

from common import HERE, read

LIMITS = (1e-4, 1e-6, 1e-9, 1e-11)  # m
RODS = (2, 20, 100, 1000, 10_000, 100_000, 1_000_000)


def duration(seconds: float | None) -> str:
    """A duration with two digits and a unit."""
    if seconds is None:
        return "-"
    return f"{seconds:.2g} s" if seconds >= 1.0 else f"{1e3 * seconds:.0f} ms"


def precision() -> str:
    """The table of the least run time within each limit of the error, by case and method."""
    groups: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for row in read("work_precision.csv"):
        if row["error_m"] and row["run_s"]:
            pair = (float(row["error_m"]), float(row["run_s"]))
            groups.setdefault((row["case"], row["method"]), []).append(pair)
    lines = ["| cheapest run within | " + " | ".join(f"{x:.0e} m" for x in LIMITS) + " |"]
    lines.append("|---" * (1 + len(LIMITS)) + "|")
    for (case, method), runs in groups.items():
        best = [min((t for e, t in runs if e <= limit), default=None) for limit in LIMITS]
        lines.append(f"| {case}: {method} | " + " | ".join(map(duration, best)) + " |")
    return "\n".join(lines)


def acceleration() -> str:
    """The table of times per acceleration for the sizes RODS."""
    head = (
        "rods",
        "call, us",
        "in a loop, us",
        "ns per rod",
        "dense, us",
        "bytes per rod",
        "copying as many bytes, ns per rod",
    )
    keys = ("rods", "call_us", "loop_us", "loop_ns_per_rod", "dense_us", "bytes_per_rod", "copy_ns_per_rod")
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for row in read("acceleration.csv"):
        if int(row["rods"]) in RODS:
            cells = [row["rods"], *(f"{float(row[k]):.3g}" if row[k] else "-" for k in keys[1:])]
            lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    """Writes the tables into README.md."""
    path = HERE / "README.md"
    text = path.read_text(encoding="utf-8")
    for name, table in (("precision", precision()), ("acceleration", acceleration())):
        place = re.compile(rf"(<!-- {name} -->\n).*?(\n<!-- end -->)", re.DOTALL)
        text, count = place.subn(lambda m, t=table: m[1] + t + m[2], text)
        if count != 1:
            raise SystemExit(f"README.md has {count} places for {name}")
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
