"""Makes the README's tables from cases.csv.

python experiments/stability/table.py    # rewrites the text between the markers in README.md
"""

import csv
import re
from pathlib import Path

HERE = Path(__file__).parent
METHODS = ("generalized-alpha", "collocation")
HEAD = (
    "case",
    "outcome",
    "balance",
    "steps",
    "it.",
    "CPU s",
    "outcome",
    "balance",
    "steps",
    "it.",
    "CPU s",
)


def digits(text: str, form: str = "{:.0e}") -> str:
    """A number with few digits, or a dash if there is none."""
    return form.format(float(text)) if text else "-"


def cells(row: dict | None) -> list[str]:
    """The cells of one run. Rejected steps and repairs follow the steps after a +."""
    if row is None or row["outcome"] == "refused":
        return ["-" if row is None else "refused", "", "", "", ""]
    extra = float(row["rejected"] or 0) + float(row["repairs"] or 0)
    steps = row["steps"] + (f" + {extra:.0f}" if extra else "")
    outcome = row["outcome"]
    if outcome in ("gave up", "too slow"):
        outcome += f" at {digits(row['reached_s'], '{:g}')} s"
    balance = digits(row["of_exchanged"])
    return [outcome, balance, steps, digits(row["iterations"], "{:.1f}"), digits(row["run_s"], "{:.2g}")]


def table(rows: list[dict]) -> str:
    """The table with a row per case: both methods, and their difference at the end."""
    head = (*HEAD, "tips apart", "reactions apart")
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for name in dict.fromkeys(row["case"] for row in rows):
        pair = [[r for r in rows if (r["case"], r["method"]) == (name, method)] for method in METHODS]
        pair = [found[0] if found else None for found in pair]
        apart = [digits(pair[0][key] if pair[0] else "") for key in ("tips_off", "reactions_off")]
        lines.append("| " + " | ".join([name, *cells(pair[0]), *cells(pair[1]), *apart]) + " |")
    return "\n".join(lines)


def finer(rows: list[dict]) -> str:
    """The table of the runs with finer steps, beside the default ones."""
    head = ("case", *(f"{m}, {what}" for m in METHODS for what in ("tips", "reactions", "balance")))
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for name in dict.fromkeys(row["case"] for row in rows if row["method"].endswith("finer")):
        found = {row["method"]: row for row in rows if row["case"] == name}
        line = [name]
        for method in METHODS:
            pair = [found.get(m, {}) for m in (method, f"{method}, finer")]
            for key in ("tips_off", "reactions_off", "of_exchanged"):
                line.append(" -> ".join(digits(row.get(key, "")) for row in pair))
        lines.append("| " + " | ".join(line) + " |")
    return "\n".join(lines)


def main() -> None:
    """Writes the tables into README.md."""
    with (HERE / "cases.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    path = HERE / "README.md"
    text = path.read_text(encoding="utf-8")
    for name, lines in (("cases", table(rows)), ("finer", finer(rows))):
        place = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        text, count = place.subn(lambda m, t=lines: f"{m[1]}{t}\n{m[2]}", text)
        if count != 1:
            raise SystemExit(f"README.md has {count} places for {name}")
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
