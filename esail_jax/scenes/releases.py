"""When which tethers of a sail are released."""

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


def releases(scene: Scene) -> dict[float, list[int]]:
    """Returns the numbers of the tethers that are released, from 1, by the instant [s] of their release, in
    the order of the instants."""
    found: dict[float, list[int]] = {}
    event = scene.event
    if event is not None:
        pairs = zip(np.atleast_1d(event.time), np.atleast_1d(event.release), strict=True)
        for begin, number in sorted((float(time), int(tether)) for time, tether in pairs):
            found.setdefault(begin, []).append(number)
    return found
