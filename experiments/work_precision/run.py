"""Measures error and run time of the package's methods, of an explicit method and of Exudyn.

pip install '.[peers]'
taskset -c 1 python experiments/work_precision/run.py [scene ...]    # <scene>.jsonl, a line per run
python experiments/work_precision/tables.py                          # table.csv, figure, tables
"""

import importlib.metadata
import importlib.util
import json
import sys
import time
from pathlib import Path

import rk4
from scenes import CASES, Case

import esail_jax as esail
from esail_jax.commands import benchmark as bench
from esail_jax.commands.benchmark import Reference, Run
from esail_jax.compilation.stored import STORE

HERE = Path(__file__).parent
PEER = HERE.parent / "peer_exudyn"

TOLERANCE = 1e-5
"""Tolerance of Exudyn's Newton iterations: a third faster than 1e-9; tips agree to 1e-7 m after 100 s."""

SHORT = 400.0
"""Simulated time [s] of the two repetitions of an Exudyn run; their run times are extrapolated."""


def exudyn(scene: esail.Scene, step: float) -> Run:
    """Runs Exudyn on the same sail: the whole span once, a part of it twice."""
    if str(PEER) not in sys.path:
        sys.path.insert(0, str(PEER))
    import sail
    from inputs import sail_of
    from signals import signals

    given, every = sail_of(scene), round(scene.output.interval / step)
    steps, short = round(scene.integrator.t_end / step), round(SHORT / step)

    began = time.process_time()
    whole = sail.simulate(given, step, steps, every, tolerance=TOLERANCE)
    processor = time.process_time() - began
    parts = [sail.simulate(given, step, short, every, tolerance=TOLERANCE).seconds for _ in range(2)]
    seconds = (whole.seconds, *(steps / short * part for part in parts))
    return Run("exudyn", "step", step, signals(given, whole), steps, 0.0, seconds, (processor,))


def compared(run: Run, reference: Reference) -> dict[str, float]:
    """The errors of a run, which may be shorter than the reference or have fewer observables."""
    names = [name for name in reference.names if name in run.rows]
    rows = len(run.rows[names[0]])
    return bench.errors(run.rows, {name: reference.rows[name][:rows] for name in names}, names)


def lines(case: Case):
    """Yields a table line for every run of a scene, the reference first."""
    scene, t_end = case.scene, case.scene.integrator.t_end
    reference, first = bench.reference_line(scene)
    yield first
    for method, key, values in case.curves:
        for value in values:
            run = bench.measure(scene, method, key, value)
            yield bench.line(run, compared(run, reference), role="run", span=t_end)
    for step in case.exudyn:
        run = exudyn(scene, step)
        yield bench.line(run, compared(run, reference), role="peer", span=t_end)
    step, span = case.rk4
    run = rk4.measure(scene, step, span)
    yield bench.line(run, compared(run, reference), role="explicit", span=span)


def main(names: list[str]) -> None:
    """Runs the named cases and writes <scene>.jsonl."""
    about = bench.machine()
    STORE.switch_off()  # compile times are measured
    if importlib.util.find_spec("exudyn"):
        about["versions"]["exudyn"] = importlib.metadata.version("exudyn")
    for name in names:
        case = CASES[name]
        about |= {"scene": name, "t_end": case.scene.integrator.t_end}
        with open(HERE / f"{name}.jsonl", "w", encoding="utf-8") as file:
            for entry in lines(case):
                print(name, bench.text_of(bench.table_row(entry)), flush=True)
                print(json.dumps(about | entry), file=file, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or list(CASES))
