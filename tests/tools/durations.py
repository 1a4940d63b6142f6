"""Writes DURATIONS.md, the table of how long tests take, from `durations.json`.

    python tests/tools/durations.py                      write the table anew
    python tests/tools/durations.py NAME SECONDS         enter the wall time of a session first

NAME is one of `SESSIONS`. The seconds of the tests themselves are measured by
`python3 bootstrap.py test -m "" --write-durations`. No other document states such a time.
"""

import json
import sys
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from support.durations import FILE, GROUPS, read  # noqa: E402

TABLE = ROOT / "DURATIONS.md"

SESSIONS = {
    "default": ("default tests", "`python3 bootstrap.py test`"),
    "gate": ("the gate, nothing kept from before", "`.ci/run`"),
    "gate again": ("the gate, with programs kept from before", "`.ci/run`"),
    "nightly": ("all tests with the oldest JAX", "`.ci/nightly oldest`"),
    "perturbations": ("all perturbations", "`python tests/tools/mutations.py --gate`"),
}
"""Sessions of tests: what each is, and its command."""


def table(found: dict) -> str:
    """The text of DURATIONS.md."""
    lines = [
        "# How long the tests take",
        "",
        "Written by `python tests/tools/durations.py` from `durations.json`, which holds"
        " the duration of every test.",
        "",
        "| what | command | wall time on two cores |",
        "|---|---|---|",
    ]
    for name, (what, command) in SESSIONS.items():
        lines.append(f"| {what} | {command} | {in_words(found['sessions'].get(name))} |")
    lines += [
        "",
        f"Durations of single tests: {found.get('measured', 'not measured yet')}. *gate*: nightly tests"
        " that the gate runs, too (`tests/gate.toml`); *nightly*: all others that are not default tests.",
        "",
        "| folder of `tests/` | default | s | gate | s | nightly | s |",
        "|---|---|---|---|---|---|---|",
    ]
    counts, seconds = Counter(), Counter()
    for group in GROUPS:
        for name, duration in found[group].items():
            for room in (name.partition("/")[0], "all"):
                counts[room, group] += 1
                seconds[room, group] += duration or 0.0
    rooms = sorted({room for room, _ in counts} - {"all"})
    for room in [*rooms, "all"]:
        cells = [f"{counts[room, group]:,} | {seconds[room, group]:.0f}" for group in GROUPS]
        lines.append(f"| {room} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def in_words(seconds: float | None) -> str:
    """A duration as minutes."""
    return "not measured yet" if seconds is None else f"{seconds / 60.0:.1f} minutes"


def main(arguments: list[str]) -> int:
    """Writes the table; returns 2 for arguments that are no session with its seconds."""
    found = read()
    if arguments:
        if len(arguments) != 2 or arguments[0] not in SESSIONS:
            print(
                f"NAME must be one of {', '.join(SESSIONS)}, with SECONDS, but is {arguments}",
                file=sys.stderr,
            )
            return 2
        found["sessions"][arguments[0]] = float(arguments[1])
        FILE.write_text(json.dumps(found, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    TABLE.write_text(table(found), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
