"""Judges the statements of [PGV] Sec. 4 and 5 by runs, and lists its figures beside those made here.

    python experiments/pgv_statements/run.py

Writes STATEMENTS.md, statements.csv and FIGURES.md beside this file. Runs that other scripts of this study
have made are not repeated.
"""

import csv
import sys
from collections import Counter
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "pgv_common"))

import convergence  # noqa: F401  (these modules fill STATEMENTS)
import long_time  # noqa: F401
import sail  # noqa: F401
import tether  # noqa: F401
from figures import FIGURES
from judged import STATEMENTS
from measures import all_runs
from table2 import table

HEAD = """# Statements of [PGV] Sec. 4 and 5, judged by runs

Written by `python experiments/pgv_statements/run.py`. Numbers are measured in runs of the baseline over
three spin periods by the paper's method (generalized-alpha, 0.1 s), or in `pgv_long_runs` where the text
says so. The conditions for a verdict are in the scripts of this folder. {counts}.

| | section | figure | the paper says | verdict | measured |
|---|---|---|---|---|---|
"""

FIGURES_HEAD = """# The figures and tables of [PGV], made anew

Written by `python experiments/pgv_statements/run.py`. Panels have the letters of the paper.
"""


def statements() -> list[dict]:
    """Judges all statements; one row each."""
    runs, rows = all_runs(), []
    for k, entry in enumerate(sorted(STATEMENTS, key=lambda entry: entry.section)):
        verdict = entry.judge(runs)
        rows.append(
            {
                "number": k + 1,
                "section": entry.section,
                "figure": entry.figure,
                "statement": entry.says,
                "verdict": verdict.word,
                "measured": verdict.numbers,
            }
        )
    return rows


def figure_page() -> str:
    """The page of figures. Raises FileNotFoundError if one of them is missing."""
    lines = [FIGURES_HEAD, "| figure of the paper | ours | command |", "|---|---|---|"]
    for entry in FIGURES:
        if entry.file and not (HERE / entry.file).exists():
            raise FileNotFoundError(entry.file)
        ours = f"[{entry.what}]({entry.file})" if entry.file else entry.what
        lines.append(f"| {entry.number} | {ours} | `{entry.command}` |")
    lines += ["", "## Table 2: frequencies", "", table().rstrip()]
    for entry in FIGURES:
        if entry.file.endswith(".png"):
            lines += ["", f"## {entry.number}: {entry.what}", "", f"![{entry.number}]({entry.file})"]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Writes all files and prints the verdicts."""
    rows = statements()
    counts = Counter(row["verdict"] for row in rows)
    total = ", ".join(f"{number} {word}" for word, number in counts.most_common())
    lines = [HEAD.format(counts=f"{len(rows)} statements: {total}")]
    for row in rows:
        word = row["verdict"] if row["verdict"] == "holds" else f"**{row['verdict']}**"
        lines.append(
            f"| {row['number']} | {row['section']} | {row['figure']} | {row['statement']} | {word} | "
            f"{row['measured']} |\n"
        )
        print(
            f"{row['number']:3d} {row['figure']:16s} {row['verdict']:14s} {row['statement']}\n      "
            f"{row['measured']}"
        )
    (HERE / "STATEMENTS.md").write_text("".join(lines), encoding="utf-8")
    with open(HERE / "statements.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    (HERE / "FIGURES.md").write_text(figure_page(), encoding="utf-8")
    print(total)


if __name__ == "__main__":
    main()
