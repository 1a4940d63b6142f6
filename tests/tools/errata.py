"""Writes errata.csv and ERRATA.md in `experiments/paper_errata/` from the ledger of equations
(`physics/oracles/`).

python tests/tools/errata.py              writes both python tests/tools/errata.py --check      ends with
status 1 if a file differs, but for the digits of errors
"""

import csv
import importlib
import io
import pkgutil
import re
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "experiments" / "paper_errata"
sys.path.insert(0, str(ROOT / "tests" / "physics"))

import oracles  # noqa: E402  (the path is set above)
from oracles.ledger import ENTRIES, Entry, Errors  # noqa: E402

COLUMNS = ("paper", "equation", "holds", "error_printed", "error_right", "consequence")
ERROR = r"\d\.\d(e[+-]\d\d)"
"""Regular expression of an error as `digits` writes it; its group is the exponent."""

PAPERS = {
    "PGV": "Pacheco-Ramos, Garcia-Vallejo, Vazquez: high-fidelity multibody model of an electric sail",
    "MW": "Ma, Wang: An efficient model of tethers for tethered satellite systems",
}

HEAD = """\
# Errata of the two papers

Every equation that states a formula, and the numbers and claims of the text that follow from them,
transcribed as printed and compared with automatic differentiation of the energies or with a derivation
of its own (`tests/physics/oracles/`). {count} entries, of which {wrong} do not hold as printed; some of
these share a cause, and a few entries check what this package does in place of a printed form. Errors are
relative, on random states of order one, "inf" where the printed form cannot be evaluated (shapes that do
not fit, 0/0, or no formula printed). What is *right* is what this package computes. Right forms agree
with the judge to 1e-10; numbers of the text to what their digits carry (half a unit of the last, unless the
entry says otherwise), orders of magnitude to half a decade. Iteration counts and errors quoted in the
consequences were measured once, on the baseline or on a cantilever bent by 45 deg; they are illustrations,
which this command does not repeat.

All entries, also those that hold, are in [errata.csv](errata.csv). This page is written by
`python tests/tools/errata.py`.
"""


def evaluated() -> list[tuple[Entry, Errors]]:
    """All entries with their errors, in the order of the papers."""
    for module in sorted(m.name for m in pkgutil.iter_modules(oracles.__path__)):
        importlib.import_module(f"oracles.{module}")
    found = sorted(ENTRIES, key=place)
    return [(entry, entry.check()) for entry in found]


def place(entry: Entry) -> tuple[int, int, int]:
    """The sort key of an entry: paper, then numbered equations (and text after one), then other
    text."""
    number = re.match(r"(after )?(\d+)(?!\.)", entry.equation)
    in_text = number is None
    return list(PAPERS).index(entry.paper), in_text, 0 if in_text else int(number[2])


def digits(error: float) -> str:
    """An error in two digits; rounding errors, whose digits differ by machine, give "<1e-10"."""
    return "<1e-10" if error <= 1e-10 else f"{error:.1e}"


def rows(found: list[tuple[Entry, Errors]]) -> list[tuple[str, ...]]:
    """The rows of the table."""
    return [
        (
            entry.paper,
            entry.equation,
            "yes" if entry.holds else "no",
            digits(errors.printed),
            digits(errors.right),
            entry.consequence,
        )
        for entry, errors in found
    ]


def table(found: list[tuple[Entry, Errors]]) -> str:
    """The text of errata.csv."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(rows(found))
    return text.getvalue()


def page(found: list[tuple[Entry, Errors]]) -> str:
    """The text of ERRATA.md: printed and right form of every misprint, then the equations that
    hold."""
    wrong = [(entry, errors) for entry, errors in found if not entry.holds]
    lines = [HEAD.format(count=len(found), wrong=len(wrong))]
    for paper, title in PAPERS.items():
        lines.append(f"\n## [{paper}] {title}\n")
        for entry, errors in wrong:
            if entry.paper == paper:
                lines += [
                    f"### {name(entry)}: {entry.title}\n",
                    f"- printed: {entry.printed}",
                    f"- right: {entry.right}",
                    f"- error of the printed form {digits(errors.printed)}, of the right one "
                    f"{digits(errors.right)}",
                    f"- {entry.consequence}\n",
                ]
        held = [
            f"{name(entry)} ({entry.title})" for entry, _ in found if entry.holds and entry.paper == paper
        ]
        lines.append(f"Holds as printed: {'; '.join(held)}.")
    return "\n".join(lines) + "\n"


def name(entry: Entry) -> str:
    """The name of an entry, such as "Eq. 24", or the place of a claim."""
    if re.match(r"\d+\.", entry.equation):
        return f"Sec. {entry.equation}"
    return f"Eq. {entry.equation}" if entry.equation[:1].isdigit() else entry.equation


def main(arguments: list[str]) -> int:
    """Writes both files, or compares them; returns the exit status."""
    found = evaluated()
    written = {FOLDER / "errata.csv": table(found), FOLDER / "ERRATA.md": page(found)}
    if arguments == ["--check"]:
        stale = [
            str(p.name) for p, text in written.items() if not same(p.read_text(encoding="utf-8"), text)
        ]
        print("stale: " + ", ".join(stale) if stale else "errata.csv and ERRATA.md are up to date")
        return 1 if stale else 0
    for path, text in written.items():
        path.write_text(text, encoding="utf-8")
    print(f"{len(found)} entries, {sum(not e.holds for e, _ in found)} do not hold as printed")
    return 0


def same(old: str, new: str) -> bool:
    """Tells whether two texts are equal but for the digits of errors, which differ by machine."""
    return re.sub(ERROR, r"\1", old) == re.sub(ERROR, r"\1", new)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
