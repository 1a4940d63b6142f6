"""From run files to moving pictures."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from esail_jax.files.reading import SavedRun, read_runs
from esail_jax.viewing.chain_motion import chain_motion
from esail_jax.viewing.motion import Motion
from esail_jax.viewing.sail_motion import sail_motion


def read_motions(paths: Sequence[Path], members: tuple[int, ...], most: int) -> list[Motion]:
    """The moving pictures of run files, or of members of ensembles.

    members: their numbers, empty for runs; most: largest number of saved instants in one picture; they are
    equally spaced and end with the last one. Raises RunFileError."""
    runs = [run for path in paths for run in read_runs(path, members)]
    motions = [motion_of(run, most) for run in runs]
    if len({motion.title for motion in motions}) == len(motions):
        return motions
    return [
        dataclasses.replace(motion, title=f"{run.path.resolve().parent.name}/{motion.title}")
        for motion, run in zip(motions, runs, strict=True)
    ]


def motion_of(run: SavedRun, most: int) -> Motion:
    """The moving picture of a run with at most `most` of its saved instants."""
    count = len(run.time)
    frames = np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))
    make = sail_motion if run.scene.chain is None else chain_motion
    return make(run, frames)
