"""The durations of all tests, in `durations.json` beside VALIDATION.md.

    python -m pytest -m "" --write-durations                    measure
    python -m pytest -m "" --write-durations --collect-only     enter new tests, drop those that are gone

The file has three groups: default tests, further tests of the gate (`gate.toml`), and those of the night.
It also tells where it was measured and how long whole sessions take (`tests/tools/durations.py`).
"""

import json
import os
import time
from collections import defaultdict
from pathlib import Path

import jax

FILE = Path(__file__).parents[2] / "durations.json"
GROUPS = "default", "gate", "nightly"

SECONDS: dict[str, float] = defaultdict(float)
"""Wall time of set-up, call and end of each test of this session."""

GROUP_OF: dict[str, str] = {}
"""The group of each test of this session."""


def group_of(keywords) -> str:
    """The group of a test by its markers."""
    return next((group for group in GROUPS[1:] if group in keywords), "default")


def pytest_addoption(parser):
    parser.addoption("--write-durations", action="store_true", help="enter the tests in durations.json")


def pytest_runtest_logreport(report):
    name = report.nodeid.removeprefix("tests/")
    SECONDS[name] += report.duration
    GROUP_OF[name] = group_of(report.keywords)


def pytest_collection_finish(session):
    if session.config.option.collectonly:
        for item in session.items:
            GROUP_OF[item.nodeid.removeprefix("tests/")] = group_of(item.keywords)


def pytest_terminal_summary(terminalreporter, config):
    """Writes the file. After a session of all tests, those that did not run are no longer in it."""
    if not config.option.write_durations:
        return
    old = read()
    known = {name: seconds for group in GROUPS for name, seconds in old.get(group, {}).items()}
    whole = config.option.markexpr == "" and not config.option.keyword and not config.option.file_or_dir
    groups = {} if whole else {name: group for group in GROUPS for name in old.get(group, {})}
    groups |= GROUP_OF
    measured = known | {name: round(seconds, 2) for name, seconds in SECONDS.items()}
    new = {"sessions": old.get("sessions", {})}
    if SECONDS and whole:
        new["measured"] = f"{os.cpu_count()} cores, JAX {jax.__version__}, {time.strftime('%Y-%m-%d')}"
    elif "measured" in old:
        new["measured"] = old["measured"]
    for group in GROUPS:
        names = sorted(name for name, own in groups.items() if own == group)
        new[group] = {name: measured.get(name) for name in names}
    FILE.write_text(json.dumps(new, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    terminalreporter.write_line(
        f"durations: {sum(len(new[group]) for group in GROUPS)} tests in {FILE.name}"
    )


def read() -> dict:
    """What the file holds, nothing if there is none."""
    return json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
