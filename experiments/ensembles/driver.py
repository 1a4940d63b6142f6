"""Measures what the driver of an ensemble costs: time, disk and memory of a piece in which nothing is
computed.

python experiments/ensembles/driver.py     # driver.csv; a few minutes

A piece has one member and one number. The draws are those of 13 numbers of a member; they are not compared
with the rules of the scene, which takes half a millisecond for each member. Each size runs in a process of
its own.
"""

import csv
import multiprocessing
import resource
import tempfile
import time
from concurrent.futures import Executor, Future
from pathlib import Path

import numpy as np

import esail_jax as esail
from esail_jax.ensembles.driver import drive
from esail_jax.ensembles.ensemble_file import parts_of
from esail_jax.ensembles.merging import merge_pieces
from esail_jax.ensembles.pieces import Piece, files_in
from esail_jax.ensembles.task import task_of
from esail_jax.ensembles.work import Prepared, prepare

SIZES = (10_000, 100_000, 1_000_000)
PIECE = {10_000: 1, 100_000: 1, 1_000_000: 8}
"""Members of a piece."""

VARY = ("tethers.length[*]=normal:10e3:10", "initial.spin_rate=normal:4e-3:4e-5")


class Nothing(Executor):
    """Answers at once, with made-up numbers."""

    def __init__(self, size: int):
        self._size = size

    def submit(self, function, /, work, *_):
        future = Future()
        if function is prepare:
            future.set_result(Prepared(self._size, True, 0.25))
            return future
        count = len(work.members)
        rows = {"kinetic_energy.mean": work.members * 1.0}
        whole = np.ones(count, bool)
        piece = Piece(work.members, whole, ("",) * count, np.ones(count), rows, (0.0, 0.0), "none")
        future.set_result(piece)
        return future


def peak() -> float:
    """The largest memory of this process until now [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def measure(count: int) -> tuple[float, ...]:
    """Milliseconds for each piece in the driver and in the merging, bytes of a piece, and megabytes of
    memory that were added."""
    scene = esail.load_scene("baseline")
    task = task_of(scene, count, VARY, observables=["kinetic_energy"], reduce=["mean"])
    size, before = PIECE[count], peak()
    pieces = -(-count // size)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        began = time.perf_counter()
        drive(task, folder, np.ones(count, bool), Nothing(size))
        driven = time.perf_counter()
        written = sum(path.stat().st_size for path in files_in(parts_of(folder)))
        merge_pieces(folder, task)
        merged = time.perf_counter()
    times = (1e3 * (driven - began) / pieces, 1e3 * (merged - driven) / pieces)
    return size, *times, written / pieces, before, peak() - before


def main() -> None:
    """Measures all sizes and writes driver.csv."""
    names = (
        "members",
        "piece",
        "driver_ms",
        "merge_ms",
        "piece_bytes",
        "memory_before_mb",
        "memory_added_mb",
    )
    with open(Path(__file__).with_suffix(".csv"), "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(names)
        for count in SIZES:
            with multiprocessing.get_context("spawn").Pool(1) as pool:
                row = pool.apply(measure, (count,))
            table.writerow((count, *(f"{x:.4g}" for x in row)))
            print(count, *(f"{x:.4g}" for x in row), flush=True)


if __name__ == "__main__":
    main()
