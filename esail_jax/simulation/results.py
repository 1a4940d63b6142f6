"""The intermediate results of a run on the host: chunks and checkpoints."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from esail_jax.simulation.statistics import Pending


class Chunk(NamedTuple):
    """The results at consecutive saved instants, as `esail.run` yields them.

    time: the instants [s]; observables: arrays by name, first axis `time`; numerics: statistics of the
    steps by name, with the axis `time`; reached: time at the end of the last step [s], which is the last of
    these instants or later."""

    time: np.ndarray
    observables: dict[str, np.ndarray]
    numerics: dict[str, np.ndarray]
    reached: float


class Checkpoint(NamedTuple):
    """All data from which a run, or a longer run of the same scene, continues with the same bits.

    motion: the stepper's state and its last block (`stepper.Motion`; read from a file: arrays by path);
    rows: number of instants saved so far that every longer run saves, too (a last instant that is no
    multiple of the interval does not count); segment: number of switch times passed; pending: the steps
    since the last of these rows; energy: for a chain the energy at the start and the largest kinetic energy
    so far [J]; carried: what changes at switch times only (`problem.Carried`; read from a file: arrays by
    path)."""

    motion: Any
    rows: int
    segment: int
    pending: Pending
    energy: tuple[float, float]
    carried: Any

    @property
    def control(self) -> Any:
        """What a sampled voltage law holds, and its memory; None without such a law."""
        return self.carried.control


def join(parts: Sequence[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Concatenates the rows of consecutive chunks. parts: at least one mapping of arrays by name."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def all_rows(
    chunks: list[Chunk], part: str, count: int, shapes: Mapping[str, tuple[int, ...]]
) -> dict[str, np.ndarray]:
    """Rows of all chunks, filled up with NaN to `count` instants: a failed run does not reach all. shapes:
    those of the rows at one instant, for a run that reached none."""
    if chunks:
        rows = join([getattr(chunk, part) for chunk in chunks])
    else:
        rows = {name: np.zeros((0, *shape)) for name, shape in shapes.items()}
    missing = {name: np.full((count - len(x), *x.shape[1:]), np.nan) for name, x in rows.items()}
    return {name: np.concatenate([x, missing[name]]) for name, x in rows.items()}
