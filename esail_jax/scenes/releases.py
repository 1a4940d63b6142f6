"""Which tethers of a sail are released at given instants."""

import numpy as np

from esail_jax.scenes.scene import Scene


def released(scene: Scene, time: np.ndarray) -> np.ndarray:
    """Tells which tethers of a sail are released at saved instants [s] (instant, tether)."""
    found = np.zeros((len(time), scene.tethers.count), bool)
    event = scene.event
    if event is not None:
        for begin, number in zip(np.atleast_1d(event.time), np.atleast_1d(event.release), strict=True):
            found[:, int(number) - 1] |= time >= begin
    return found
