"""How long the tests take is stated in one place, DURATIONS.md, which is written from `durations.json`."""

import importlib.util
import re
from pathlib import Path

from support.durations import read

ROOT = Path(__file__).parents[2]

SPEC = importlib.util.spec_from_file_location("durations_tool", ROOT / "tests" / "tools" / "durations.py")
TOOL = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(TOOL)

COMMANDS = re.compile(r"bootstrap\.py test|mutations\.py|\.ci/(run|nightly)")
TIMES = re.compile(r"\b(seconds|minutes?|hours?)\b")


def test_table_is_that_of_the_file():
    """`python tests/tools/durations.py` would change nothing."""
    assert (ROOT / "DURATIONS.md").read_text(encoding="utf-8") == TOOL.table(read())


def test_no_other_document_says_how_long_the_tests_take():
    """No line that names a command of the tests names a time as well. The changelog is history."""
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("experiments/**/*.md")]
    for page in pages:
        if page.name not in ("CHANGELOG.md", "DURATIONS.md"):
            for line in page.read_text(encoding="utf-8").splitlines():
                assert not (COMMANDS.search(line) and TIMES.search(line)), (
                    f"{page.relative_to(ROOT)}: {line}"
                )
