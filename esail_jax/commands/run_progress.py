"""The live line of `esail run` on a terminal."""

import numpy as np

from esail_jax.commands.progress import Progress
from esail_jax.scenes.scene import Scene
from esail_jax.simulation.results import Chunk


class RunProgress(Progress):
    """The line of a run: simulated time, speed, remaining time, and as far as the terminal is wide enough
    the length of the last step, the iterations per step and the error of the energy balance."""

    def __init__(self, scene: Scene, quiet: bool = False):
        super().__init__(scene.integrator.t_end, self.texts, quiet)
        self.latest: Chunk | None = None

    def show(self, chunk: Chunk) -> None:
        """Reports the newest results of the run."""
        self.latest = chunk
        self.update(chunk.reached)

    def texts(self, reached: float, speed: float) -> tuple[str, ...]:
        """Returns the texts of the line, the most important first. reached: simulated time [s]; speed:
        simulated seconds per second."""
        found = [f"{min(reached, self.total):.0f} of {self.total:.0f} s", f"{speed:.0f} x real time"]
        chunk = self.latest
        if chunk is None or not len(chunk.time):
            return tuple(found)
        found.append(f"step {chunk.numerics['last_step'][-1]:.3g} s")
        if "iterations_per_step" in chunk.numerics:
            found.append(f"{chunk.numerics['iterations_per_step'][-1]:.1f} iterations")
        for name, unit in (("energy_balance_error", " J"), ("energy_error", "")):
            if name in chunk.observables:
                found.append(f"energy error {np.abs(chunk.observables[name][-1]):.0e}{unit}")
                break
        return tuple(found)
