"""From run files to moving pictures."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from esail_jax.files.reading import IN_MEMORY, SavedRun, read_runs
from esail_jax.viewing.chain_motion import chain_motion
from esail_jax.viewing.motion import Motion
from esail_jax.viewing.sail_motion import sail_motion


def read_motions(sources: Sequence[Any], members: tuple[int, ...], most: int) -> list[Motion]:
    """The moving pictures of runs, or of members of ensembles, in files or in memory.

    members: their numbers, empty for runs; most: largest number of saved instants in one picture; they are
    equally spaced and end with the last one. Raises RunFileError."""
    runs = [run for source in sources for run in read_runs(source, members)]
    motions = [motion_of(run, most) for run in runs]
    if len({motion.title for motion in motions}) == len(motions):
        return motions
    return [
        dataclasses.replace(motion, title=own_title(motion, run, k + 1))
        for k, (motion, run) in enumerate(zip(motions, runs, strict=True))
    ]


def own_title(motion: Motion, run: SavedRun, number: int) -> str:
    """The title of one of several runs of the same name: with the folder of a file, or with the number of
    one in memory."""
    if run.path == IN_MEMORY:
        return f"{motion.title} {number}"
    return f"{run.path.resolve().parent.name}/{motion.title}"


def motion_of(run: SavedRun, most: int) -> Motion:
    """The moving picture of a run with at most `most` of its saved instants."""
    count = len(run.time)
    frames = np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))
    make = sail_motion if run.scene.chain is None else chain_motion
    return make(run, frames)
