"""Perturbs the package one coefficient at a time and records the tests that notice.

    python tests/tools/mutations.py [NAME ...]           all mutations, or those whose name contains NAME
    python tests/tools/mutations.py --gate [NAME ...]    with the tests of the gate only (`tests/gate.toml`)

A mutation replaces one piece of text in a copy of the package. The tests that noticed it the last time
run against the copy first. If none of them fails, all tests named with the mutation run until three have
failed. With `--gate`, tests that only the night runs are left out. At the end every test that noticed a
mutation must pass on an unchanged copy. The result is written to `experiments/mutations/mutations.csv`.
The exit status is 1 if no test notices a mutation, or if a test fails without a mutation.

All runs share one folder of programs compiled by JAX, whose key is the program itself: a mutation compiles
only what it changes.
"""

import concurrent.futures
import csv
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from support.perturbations import mutations, path_of  # noqa: E402

TABLE = ROOT / "experiments" / "mutations" / "mutations.csv"

# Without -P the working directory, with the unchanged package, would come before PYTHONPATH.
PYTEST = [sys.executable, "-P", "-m", "pytest", "-q", "--tb=no", "-p", "no:cacheprovider"]
EVERY, GATE = "", "gate or not nightly"
"""Markers of all tests, and of those of the gate."""

NOTHING_CHOSEN, NOT_FOUND = 5, 4
"""Exit status of pytest if every test that is asked for is left out by its marker, and if one does not
exist, for example because it was renamed."""


def copy_packages(folder: Path) -> None:
    """Copies the package and the one beside it."""
    for package in ("esail_jax", "kept_programs"):
        shutil.copytree(ROOT / package, folder / package)


def mutated_copy(mutation: dict, folder: Path) -> None:
    """Copies the packages and replaces one text, which must occur exactly once."""
    copy_packages(folder)
    path = folder / path_of(mutation)
    text = path.read_text(encoding="utf-8")
    if text.count(mutation["old"]) != 1:
        raise SystemExit(f"{mutation['name']}: its text is not in {mutation['file']} exactly once")
    path.write_text(text.replace(mutation["old"], mutation["new"]), encoding="utf-8")


def run(name: str, package: Path, programs: Path, markers: str, options: list[str]) -> list[str] | None:
    """Runs tests on the package in a folder and returns the names of those that fail; returns None if they
    cannot run, for example because one does not exist."""
    folders = {"JAX_COMPILATION_CACHE_DIR": str(programs), "ESAIL_CACHE": str(package / "programs")}
    environment = os.environ | folders | {"PYTHONPATH": str(package)}
    result = subprocess.run(
        [*PYTEST, "-m", markers, *options], cwd=ROOT, env=environment, capture_output=True, text=True
    )
    if result.returncode == NOT_FOUND:
        return None
    if result.returncode == NOTHING_CHOSEN:
        return []
    failed = re.findall(r"^FAILED (?:tests/)?(.*?)(?: - .*)?$", result.stdout, flags=re.MULTILINE)
    if result.returncode not in (0, 1, 2) or ("error" in result.stdout.splitlines()[-1] and not failed):
        print(f"{name}: the tests did not run\n{result.stdout[-2000:]}{result.stderr}", flush=True)
        return None
    return failed


def failing_tests(mutation: dict, before: list[str], programs: Path, markers: str) -> list[str]:
    """The names of the tests that fail on the mutated copy, at most three: of those that failed
    `before`, or else of all that are named with the mutation."""
    with tempfile.TemporaryDirectory() as folder:
        mutated_copy(mutation, Path(folder))
        fixed = mutation["name"], Path(folder), programs, markers
        caught = run(*fixed, [f"tests/{test}" for test in before]) if before else None
        caught = caught or run(*fixed, ["--maxfail=3", *mutation["tests"]])
    print(f"{mutation['name']}: {', '.join(caught or []) or 'no test fails'}", flush=True)
    return caught or []


def control(tests: list[str], programs: Path) -> list[str] | None:
    """The names of the tests that fail on an unchanged copy."""
    if not tests:  # pytest would run all tests
        return []
    with tempfile.TemporaryDirectory() as folder:
        copy_packages(Path(folder))
        several = ["-n", "auto", "--dist", "worksteal"]
        return run("control", Path(folder), programs, EVERY, several + [f"tests/{test}" for test in tests])


def recorded() -> dict[str, list[str]]:
    """The failing tests by mutation, as the table has them."""
    if not TABLE.exists():
        return {}
    with TABLE.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {row["term"]: row["tests that fail"].split("; ") for row in rows if row["tests that fail"]}


def main(arguments: list[str]) -> int:
    """Runs the mutations, one per core, and enters them in the table; returns 1 if one is not noticed."""
    names = [name for name in arguments if name != "--gate"]
    markers = EVERY if names == arguments else GATE
    chosen = [m for m in mutations() if not names or any(name in m["name"] for name in names)]
    known = recorded()
    with tempfile.TemporaryDirectory() as programs:
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            caught = list(
                pool.map(
                    lambda m: failing_tests(m, known.get(m["name"], []), Path(programs), markers), chosen
                )
            )
        wrong = control(sorted({test for tests in caught for test in tests}), Path(programs))
    if wrong != []:
        print("These tests fail, or do not run, although nothing is changed:", *wrong or ["all"])
        caught = [[test for test in tests if wrong is not None and test not in wrong] for tests in caught]
    found = known | {m["name"]: tests for m, tests in zip(chosen, caught, strict=True)}
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("term", "file", "before", "after", "tests that fail"))
        for mutation in mutations():
            if found.get(mutation["name"]):
                cells = (mutation[key].strip() for key in ("name", "file", "old", "new"))
                table.writerow((*cells, "; ".join(found[mutation["name"]])))
    survivors = [m["name"] for m, tests in zip(chosen, caught, strict=True) if not tests]
    print(f"{len(chosen)} mutations, {len(survivors)} unnoticed {survivors or ''}")
    return 1 if survivors or wrong != [] else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
