"""Perturbs the physics one coefficient at a time and records the tests that notice.

    python tests/tools/mutations.py [NAME ...]      all mutations, or those whose name contains NAME

A mutation replaces one piece of text in a copy of the package. Its tests then run against the copy until
three have failed; before, they must pass on an unchanged copy. The result is written to
`experiments/mutations/mutations.csv`. The exit status is 1 if no test notices a mutation.
"""

import concurrent.futures
import csv
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
LISTS = ROOT / "tests" / "architecture" / "mutations"
TABLE = ROOT / "experiments" / "mutations" / "mutations.csv"

# Without -P the working directory, with the unchanged package, would come before PYTHONPATH.
PYTEST = [sys.executable, "-P", "-m", "pytest", "-q", "--tb=no", "--maxfail=3"]
PYTEST += ["-p", "no:cacheprovider", "-m", ""]


def mutations() -> list[dict]:
    """Returns all mutations, each with name, file, old, new and tests (arguments of pytest)."""
    found = []
    for path in sorted(LISTS.glob("*.toml")):
        found += tomllib.loads(path.read_text(encoding="utf-8"))["mutation"]
    return found


def mutated_copy(mutation: dict, folder: Path) -> None:
    """Copies the package and replaces one text, which must occur exactly once; without a file it only
    copies."""
    shutil.copytree(ROOT / "esail_jax", folder / "esail_jax")
    if mutation["file"] is None:
        return
    path = folder / "esail_jax" / mutation["file"]
    text = path.read_text(encoding="utf-8")
    if text.count(mutation["old"]) != 1:
        raise SystemExit(f"{mutation['name']}: its text is not in {mutation['file']} exactly once")
    path.write_text(text.replace(mutation["old"], mutation["new"]), encoding="utf-8")


def failing_tests(mutation: dict) -> list[str]:
    """Returns the names of the tests that fail on the mutated copy, at most three."""
    with tempfile.TemporaryDirectory() as name:
        mutated_copy(mutation, Path(name))
        environment = os.environ | {"PYTHONPATH": name}
        run = subprocess.run(
            PYTEST + mutation["tests"], cwd=ROOT, env=environment, capture_output=True, text=True
        )
    if run.returncode not in (0, 1, 2) or "error" in run.stdout.splitlines()[-1]:
        raise SystemExit(f"{mutation['name']}: the tests did not run\n{run.stdout[-2000:]}{run.stderr}")
    caught = re.findall(r"^FAILED (?:tests/)?(.*?)(?: - .*)?$", run.stdout, flags=re.MULTILINE)
    print(f"{mutation['name']}: {', '.join(caught) or 'no test fails'}", flush=True)
    return caught


def control(chosen: list[dict]) -> None:
    """Checks that all chosen tests pass on an unchanged copy."""
    tests = sorted({tuple(mutation["tests"]) for mutation in chosen}, key=len)
    alone = sorted({name for group in tests if "-k" not in group for name in group})
    groups = ([alone] if alone else []) + [list(group) for group in tests if "-k" in group]
    for group in groups:
        if failing_tests({"name": "control", "file": None, "tests": group}):
            raise SystemExit("a test fails although nothing is changed")


def recorded() -> dict[str, str]:
    """Returns the failing tests by mutation, as the table has them."""
    if not TABLE.exists():
        return {}
    with TABLE.open(encoding="utf-8") as file:
        return {row["term"]: row["tests that fail"] for row in csv.DictReader(file)}


def main(names: list[str]) -> int:
    """Runs the mutations, one per core, and enters them in the table; returns 1 if one is not noticed."""
    chosen = [m for m in mutations() if not names or any(name in m["name"] for name in names)]
    control(chosen)
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        caught = list(pool.map(failing_tests, chosen))
    found = recorded() | {m["name"]: "; ".join(tests) for m, tests in zip(chosen, caught, strict=True)}
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("term", "file", "before", "after", "tests that fail"))
        for mutation in mutations():
            if mutation["name"] in found:
                cells = (mutation[key].strip() for key in ("name", "file", "old", "new"))
                table.writerow((*cells, found[mutation["name"]]))
    survivors = [m["name"] for m, tests in zip(chosen, caught, strict=True) if not tests]
    print(f"{len(chosen)} mutations, {len(survivors)} unnoticed {survivors or ''}")
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
