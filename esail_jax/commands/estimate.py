"""`esail run --estimate`: what a run will cost, from its first seconds. It writes nothing that stays."""

import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from esail_jax.commands.cache import in_words
from esail_jax.commands.progress import RunProgress, clock
from esail_jax.commands.reports import size_of
from esail_jax.commands.running import Requested, names_with
from esail_jax.compilation.announcements import announced_to
from esail_jax.files.run_file import Content, RunWriter, progress_of
from esail_jax.scenes.scene import Scene
from esail_jax.simulation.host import HostRun, compile_scene
from esail_jax.simulation.schedule import save_times

SECONDS = 3.0
"""Time for which the run is tried [s]. It ends with the first saved instant after it."""


class Trial(NamedTuple):
    """The beginning of a run. reached: simulated time [s]; rows: number of saved instants; steps: their
    number; compiling, running: seconds; empty, size: bytes of the run file without rows and with these."""

    reached: float
    rows: int
    steps: int
    compiling: float
    running: float
    empty: int
    size: int


def print_estimate(scene: Scene, requested: Requested, quiet: bool) -> None:
    """Prints how many steps a run will take, how long it will last, and how large its file and its memory
    will be. The rest of the run is taken to go like its first seconds. requested:
    observables that are saved, too.

    Raises SceneError, and SimulationError if the run fails within these seconds."""
    progress = RunProgress(scene, quiet)
    try:
        with announced_to(progress.stage):
            trial = tried(scene, requested)
    finally:
        progress.close()
    print(estimate_text(scene, trial, peak_memory()))


def tried(scene: Scene, requested: Requested) -> Trial:
    """Runs a scene for SECONDS, into a file in a folder of its own, which is removed."""
    began = time.perf_counter()
    compiled = compile_scene(scene, names=names_with(scene, requested) if requested else None)
    compiling = time.perf_counter() - began
    run, reached, rows = HostRun(compiled), compiled.start_time, 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trial.h5"
        writer = RunWriter(path, Content.of_run(compiled), resume=False)
        writer.write(progress_of(run, (compiling, 0.0)))
        empty, ready = path.stat().st_size, time.perf_counter()
        for chunk in run.chunks():
            writer.add(chunk)
            reached, rows = chunk.reached, rows + len(chunk.time)
            if time.perf_counter() - ready >= SECONDS:
                break
        running = time.perf_counter() - ready
        writer.write(progress_of(run, (compiling, running)))
        size = path.stat().st_size
    return Trial(reached, rows, run.steps, compiling, running, empty, size)


def estimate_text(scene: Scene, trial: Trial, memory: float | None) -> str:
    """The estimate as lines of text. memory: largest memory of the process so far [bytes], None if
    the system does not tell."""
    end = scene.integrator.t_end
    factor = max(end / trial.reached, 1.0) if trial.reached > 0.0 else 1.0
    saved = len(save_times(end, scene.output.interval))
    whole = trial.reached >= end
    size = trial.empty + (trial.size - trial.empty) * saved / max(trial.rows, 1)
    basis = "the whole run was tried" if whole else f"from the first {trial.reached:.4g} s"
    lines = [
        f"{size_of(scene)}, {end:g} s, {saved} saved instants ({basis})",
        f"  steps      {trial.steps if whole else rounded(trial.steps * factor)}",
        f"  time       {clock(trial.running * factor)} after compiling, which took {trial.compiling:.1f} s",
        ""
        if memory is None
        else f"  memory     {in_words(round(memory))}, which does not grow with the run",
        f"  file       {in_words(round(size))}",
    ]
    return "\n".join(line for line in lines if line)


def peak_memory() -> float | None:
    """The largest memory of this process so far [bytes]; None if the system does not tell."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(peak if sys.platform == "darwin" else 1024 * peak)


def rounded(number: float) -> str:
    """A number to two digits, without an exponent."""
    return f"{float(f'{number:.2g}'):,g}" if number < 1e6 else f"{float(f'{number:.2g}'):,.0f}"
