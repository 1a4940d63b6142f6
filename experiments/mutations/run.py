"""Perturb the physics one coefficient at a time, and record which tests notice.

    python experiments/mutations/run.py [NAME ...]      all mutations, or those whose name contains NAME

A mutation replaces one piece of text in a copy of the package; the listed tests then run against the
copy, until three have failed. Writes mutations.csv: term, mutation, tests that fail. Ends with status 1
if one goes unnoticed.
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
LISTS = ROOT / "tests" / "mutations"
TABLE = Path(__file__).with_name("mutations.csv")

# -P: the working directory would come before PYTHONPATH, and the package there is whole.
PYTEST = [sys.executable, "-P", "-m", "pytest", "-q", "--tb=no", "--maxfail=3"]
PYTEST += ["-p", "no:cacheprovider", "-m", ""]


def mutations() -> list[dict]:
    """All mutations: name, file, old, new, tests (what to run)."""
    found = []
    for path in sorted(LISTS.glob("*.toml")):
        found += tomllib.loads(path.read_text(encoding="utf-8"))["mutation"]
    return found


def mutated_copy(mutation: dict, folder: Path) -> None:
    """A copy of the package with one text replaced; the text must occur exactly once."""
    shutil.copytree(ROOT / "esail_jax", folder / "esail_jax")
    path = folder / "esail_jax" / mutation["file"]
    text = path.read_text(encoding="utf-8")
    if text.count(mutation["old"]) != 1:
        raise SystemExit(f"{mutation['name']}: its text is not in {mutation['file']} exactly once")
    path.write_text(text.replace(mutation["old"], mutation["new"]), encoding="utf-8")


def failing_tests(mutation: dict) -> list[str]:
    """Names of the tests that fail on the mutated copy, three at most."""
    with tempfile.TemporaryDirectory() as name:
        mutated_copy(mutation, Path(name))
        environment = os.environ | {"PYTHONPATH": name}
        run = subprocess.run(
            PYTEST + mutation["tests"], cwd=ROOT, env=environment, capture_output=True, text=True
        )
    if run.returncode not in (0, 1, 2) or "error" in run.stdout.splitlines()[-1]:
        raise SystemExit(f"{mutation['name']}: the tests did not run\n{run.stdout[-2000:]}{run.stderr}")
    caught = re.findall(r"^FAILED (?:tests/)?(.*?)(?: - .*)?$", run.stdout, flags=re.MULTILINE)
    print(f"{mutation['name']}: {', '.join(caught) or 'UNNOTICED'}", flush=True)
    return caught


def main(names: list[str]) -> int:
    """Run the mutations, one per core; 1 if one survives."""
    chosen = [m for m in mutations() if not names or any(name in m["name"] for name in names)]
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        caught = list(pool.map(failing_tests, chosen))
    if not names:
        with TABLE.open("w", newline="", encoding="utf-8") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow(("term", "file", "before", "after", "tests that fail"))
            for mutation, tests in zip(chosen, caught, strict=True):
                cells = (mutation[key].strip() for key in ("name", "file", "old", "new"))
                table.writerow((*cells, "; ".join(tests)))
    survivors = [m["name"] for m, tests in zip(chosen, caught, strict=True) if not tests]
    print(f"{len(chosen)} mutations, {len(survivors)} unnoticed {survivors or ''}")
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
