"""Runs stiff and extreme sails by both methods, and records which succeed, fail, or are wrong silently.

    python experiments/stability/run.py                  # everything
    python experiments/stability/run.py base truss       # groups of cases.py
    python experiments/stability/run.py --case "EA x 1000"

Writes cases.csv. Every group runs in its own process; a run that hangs is stopped and recorded.
"""

import argparse
import csv
import json
import queue
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

import numpy as np
from cases import GROUPS

HERE = Path(__file__).parent
HANG = 600.0
"""Seconds to wait for an answer of a worker; enough for its own guard, in processor time, and compiling."""

PLAIN = ("generalized-alpha", "collocation")
FINER = ("generalized-alpha, finer", "collocation, finer")
DISAGREE = 1e-2
"""Difference between the methods, relative to the range, above which a case is run again with finer
steps."""

COLUMNS = (
    "group", "case", "method", "outcome", "reached_s", "steps", "rejected", "repairs", "iterations",
    "balance_J", "of_exchanged", "of_energy", "constraint_m", "tips_off", "reactions_off", "strain",
    "run_s", "message",
)  # fmt: skip


class Worker:
    """A process that makes the runs of a group and keeps its compiled programs; it is restarted after a
    hang."""

    def __init__(self, group: str):
        self.group, self.process = group, None

    def begin(self) -> None:
        """Starts a new process and a thread that puts its lines into a queue."""
        command = [sys.executable, str(HERE / "measure.py"), self.group]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.lines: queue.Queue = queue.Queue()
        threading.Thread(target=listen, args=(self.process, self.lines), daemon=True).start()

    def row(self, name: str, method: str) -> dict:
        """The row of a run; a hang and a crash have rows, too."""
        if self.process is None:
            self.begin()
        self.process.stdin.write(json.dumps([name, method]) + "\n")
        self.process.stdin.flush()
        try:
            line = self.lines.get(timeout=HANG)
        except queue.Empty:
            self.end()
            line = json.dumps({"case": name, "method": method, "outcome": "hang", "message": ""})
        if line is None:
            self.end()
            line = json.dumps({"case": name, "method": method, "outcome": "crashed", "message": ""})
        row = json.loads(line)
        print(f"{self.group}: {name}: {method}: {row['outcome']} {row['message'][:80]}", flush=True)
        return row

    def end(self) -> None:
        """Ends the process, if there is one."""
        if self.process is not None:
            self.process.kill()
            self.process.wait()
        self.process = None


def listen(process: subprocess.Popen, lines: queue.Queue) -> None:
    """Puts a worker's lines into the queue, and None at its end."""
    for line in process.stdout:
        lines.put(line)
    lines.put(None)


def group_done(group: str, names: list[str]) -> list[dict]:
    """The rows of a group: both methods, with finer steps where they disagree."""
    worker = Worker(group)
    rows = [worker.row(name, method) for method in PLAIN for name in names]
    again = [name for name in names if disagree(rows, name)]
    rows += [worker.row(name, method) for method in FINER for name in again]
    worker.end()
    for row, other in [(row, best_of(rows, row)) for row in rows]:
        judge(row, other)
    return [{"group": group, **row} for row in rows]


def complete_row(rows: list[dict], name: str, method: str) -> dict | None:
    """The row of a complete run, None if there is none."""
    found = [r for r in rows if (r["case"], r["method"]) == (name, method) and r["outcome"] == "ran"]
    return found[0] if found and found[0]["finite"] else None


def disagree(rows: list[dict], name: str) -> bool:
    """Tells whether both runs are complete and either differ at the end or have a warning."""
    pair = [complete_row(rows, name, method) for method in PLAIN]
    if any(row is None for row in pair):
        return False
    off = [x for x in apart(*pair).values() if x is not None]
    return any(not x <= DISAGREE for x in off) or any(row["warning"] for row in pair)


def apart(row: dict, other: dict) -> dict:
    """The differences at the end, relative to the range."""
    found = {}
    for name in ("tips", "reactions"):
        size = max(row[f"{name}_range"], other[f"{name}_range"])
        gap = np.abs(np.subtract(row[name], other[name])).max()
        found[f"{name}_off"] = float(gap / size) if size > 0.0 else 0.0
    return found


def best_of(rows: list[dict], row: dict) -> dict | None:
    """The reference of a run: the finest collocation run, for that run itself the next best one."""
    for method in ("collocation, finer", "collocation", "generalized-alpha, finer", "generalized-alpha"):
        found = complete_row(rows, row["case"], method)
        if found is not None and method != row["method"]:
            return found
    return None


def judge(row: dict, other: dict | None) -> None:
    """Adds relative errors to a row, and the outcome of a complete run.

    warned: the package reports an error of the energy balance or too long a step; off: the run differs
    from the finest run, and the package reports nothing."""
    if "balance_J" not in row:
        return
    row["of_exchanged"] = row["balance_J"] / row["exchanged_J"] if row["exchanged_J"] else 0.0
    row["of_energy"] = row["balance_J"] / row["energy_J"] if row["energy_J"] else 0.0
    if row["outcome"] != "ran":
        return
    if other is not None and row["finite"]:
        row |= apart(row, other)
    far = [name for name in ("tips", "reactions") if not row.get(f"{name}_off", 0.0) <= DISAGREE]
    if not row["finite"]:
        row["outcome"] = "NaN, no message"
    elif row["warning"]:
        row |= {"outcome": "warned", "message": row["warning"]}
    elif far:
        row["outcome"] = f"{' and '.join(far)} off"


def write(rows: list[dict]) -> None:
    """Writes cases.csv; cases that were not run keep their old rows."""
    path, done = HERE / "cases.csv", {row["case"] for row in rows}
    kept = []
    if path.exists():
        with path.open(newline="") as file:
            kept = [row for row in csv.DictReader(file) if row["case"] not in done]
    order = {case.name: i for i, case in enumerate(case for group in GROUPS.values() for case in group)}
    with path.open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, extrasaction="ignore", restval="", lineterminator="\n")
        table.writeheader()
        for row in sorted(kept + rows, key=lambda row: order.get(row["case"], len(order))):
            table.writerow({k: f"{v:.3g}" if isinstance(v, float) else v for k, v in row.items()})


def main() -> None:
    """Runs the chosen groups and writes cases.csv after each of them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("groups", nargs="*", metavar="group", help=", ".join(GROUPS))
    parser.add_argument("--case", action="append", help="run only this case; may be repeated")
    parser.add_argument("--jobs", type=int, default=2, help="number of parallel workers")
    chosen = parser.parse_args()
    names = {
        group: [case.name for case in GROUPS[group] if not chosen.case or case.name in chosen.case]
        for group in chosen.groups or GROUPS
    }
    names = {group: cases for group, cases in names.items() if cases}
    with ThreadPoolExecutor(chosen.jobs) as pool:
        tasks = [pool.submit(group_done, group, cases) for group, cases in names.items()]
        for task in as_completed(tasks):
            write(task.result())


if __name__ == "__main__":
    main()
