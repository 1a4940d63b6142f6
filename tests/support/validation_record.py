"""The validation record: tests that compare with something exact or independent enter a row.

    python3 bootstrap.py test -m "" --validation write      write VALIDATION.md from this run
    python3 bootstrap.py test -m "" --validation check      compare VALIDATION.md with this run

A row is an assertion, result <= acceptance, with its reference. The check compares everything but the
digits of the results, which differ from machine to machine: rows, references, acceptances, tests. In a
session of some of the tests it compares the rows of those that ran.
"""

import math
from pathlib import Path

import pytest

FILE = Path(__file__).parents[2] / "VALIDATION.md"
COLUMNS = ("id", "case", "reference", "quantity", "result", "acceptance", "status", "test")

HEAD = """\
# Validation record

What the simulator was compared with, and how closely it agrees. Every row is an assertion of a test
and is made anew by

    python3 bootstrap.py test -m "" --validation write

Results without a unit are relative errors. A row passes if its result is not above its acceptance.
`tests/physics/systems/` holds the exact cases and `tests/physics/golden/` the independent reference code.
`experiments/paper_errata/` lists the errors of the two papers, and `experiments/peer_exudyn/` compares
with another multibody code.

"""


@pytest.fixture
def validate(request, record_property):
    """A function that asserts a result against its acceptance and records it as a row of VALIDATION.md."""

    def enter(id, case, reference, quantity, result, acceptance, unit=""):
        result, acceptance = float(result), float(acceptance)
        passed = math.isfinite(result) and result <= acceptance
        show = lambda x: f"{x:.1e} {unit}".strip()  # noqa: E731
        row = (id, case, reference, quantity, show(result), show(acceptance))
        record_property("validation", (*row, "pass" if passed else "FAIL", request.node.nodeid))
        assert passed, f"{id}: {quantity} is {result:.3e} {unit}, accepted is {acceptance:.1e}"

    return enter


def pytest_addoption(parser):
    parser.addoption("--validation", choices=("write", "check"), help="write or check VALIDATION.md")


def table(rows):
    """Markdown, rows in the order of their identifiers."""
    lines = [f"| {' | '.join(COLUMNS)} |", "|" + "---|" * len(COLUMNS)]
    for row in sorted(rows):
        lines.append(f"| {' | '.join(row[:-1])} | {test_cell(row[-1])}")
    return "\n".join(lines) + "\n"


def test_cell(name):
    """The last cell of a row, and the end of its line."""
    return "`" + name.removeprefix("tests/").replace("|", "\\|") + "` |"


def without_results(text):
    """The table's rows but for the results' digits."""
    rows = [line.split(" | ") for line in text.splitlines() if line.startswith("| ")]
    return [tuple(cell for i, cell in enumerate(row) if i != COLUMNS.index("result")) for row in rows]


def pytest_terminal_summary(terminalreporter, config):
    """Gather the rows of all reports, those of other processes too."""
    wanted = config.getoption("--validation")
    if wanted is None:
        return
    reports = terminalreporter.getreports("passed")
    rows = [value for r in reports for key, value in r.user_properties if key == "validation"]
    names = [row[0] for row in rows]
    part = config.option.markexpr or config.option.keyword or config.option.file_or_dir
    bad = terminalreporter.getreports("failed") + terminalreporter.getreports("error")
    recorded = without_results(FILE.read_text(encoding="utf-8"))
    if part:
        ran = {test_cell(report.nodeid) for report in reports}
        recorded = [*recorded[:1], *(row for row in recorded[1:] if row[-1] in ran)]
    problem = ""
    if bad or (part and wanted == "write"):
        problem = 'left as it is: it needs a run of all tests (-m "") in which none fails'
    elif len(set(names)) < len(names):
        problem = "an identifier occurs twice: " + ", ".join(
            sorted({n for n in names if names.count(n) > 1})
        )
    elif wanted == "write":
        FILE.write_text(HEAD + f"{len(rows)} rows.\n\n" + table(rows), encoding="utf-8")
    elif recorded != without_results(table(rows)):
        problem = "VALIDATION.md differs from the tests: write it anew"
    terminalreporter.write_line(f"validation record: {problem or f'{len(rows)} rows'}")
    if problem:
        terminalreporter._session.exitstatus = 1
