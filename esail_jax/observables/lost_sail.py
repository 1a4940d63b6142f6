"""Warnings that a sail is lost: tethers that lag behind by more than a right angle, a hub that has turned
over, tethers that change places, and tips that come close to other tethers.

They are found in the saved rows. The model has no contact: a run goes on where a sail would tangle.
"""

from collections.abc import Mapping

import numpy as np

from esail_jax.scenes.hub import azimuths
from esail_jax.scenes.scene import Scene

CLOSE = 0.01
"""Distance of a tip from another tether, as a fraction of the shortest tether, below which they are close.
Neighbours of a sail of a hundred tethers are six times as far apart."""


def lost_warning(rows: Mapping[str, np.ndarray], scene: Scene) -> str:
    """A sentence that says what has happened to a sail and when it was first seen, otherwise an
    empty text. A run that did not save the observables of which this follows is not judged. Released
    tethers do not count."""
    findings = [f(rows, scene) for f in (lagging, turned_over, reordered, close)]
    said = [(time, words) for time, words in filter(None, findings)]
    if not said:
        return ""
    first = min(index for index, _ in said)
    words = "; ".join(words for _, words in said)
    return f"The sail may be lost: {words} (first seen in saved row {first})."


Finding = tuple[int, str] | None
"""The number of the first saved row in which something is seen, and what, in words."""


def first_row(is_seen: np.ndarray) -> int | None:
    """The number of the first row in which something is seen; None if it is in none."""
    return int(np.argmax(is_seen)) if is_seen.any() else None


def held(scene: Scene) -> np.ndarray:
    """Tells of every tether that it is never released."""
    stays = np.ones(scene.tethers.count, bool)
    if scene.event is not None:
        stays[np.array(scene.event.release) - 1] = False
    return stays


def lagging(rows: Mapping[str, np.ndarray], scene: Scene) -> Finding:
    """Tethers that lag behind, or lead, by more than a right angle."""
    if "lagging_angle" not in rows:
        return None
    off = (np.abs(rows["lagging_angle"]) > 0.5 * np.pi) & held(scene)
    row = first_row(off.any(axis=1))
    if row is None:
        return None
    which = np.flatnonzero(off.any(axis=0)) + 1
    named = f"tether {which[0]} lags" if which.size == 1 else f"tethers {', '.join(map(str, which))} lag"
    return row, f"{named} by more than 90 deg"


def turned_over(rows: Mapping[str, np.ndarray], scene: Scene) -> Finding:
    """A hub whose spin axis is more than a right angle from the normal of the tips, in the sense in which
    it was at the start."""
    if scene.hub is None or not {"tip_position_I", "rotation_IB"} <= rows.keys() or held(scene).sum() < 3:
        return None
    tips = rows["tip_position_I"][:, held(scene)]
    area = np.cross(tips, np.roll(tips, -1, axis=1)).sum(axis=1)
    along = (area * rows["rotation_IB"][:, :, 0]).sum(axis=1)
    row = first_row(along * along[0] < 0.0)
    return None if row is None else (row, "the hub's axis is more than 90 deg from the normal of the tips")


def reordered(rows: Mapping[str, np.ndarray], scene: Scene) -> Finding:
    """Tips in another order around the axis of the hub than their roots."""
    names = {"tip_position_I", "rotation_IB"} | ({"hub_position_I"} if scene.hub is not None else set())
    if scene.tethers.count < 3 or not names <= rows.keys():
        return None
    tips = rows["tip_position_I"]
    if scene.hub is not None:
        tips = tips - rows["hub_position_I"][:, None]
    body = np.einsum("txb,tix->tib", rows["rotation_IB"], tips)
    angles = np.unwrap(np.arctan2(body[..., 2], body[..., 1]), axis=0)[:, held(scene)]
    roots = azimuths(scene.hub, scene.tethers.count)[held(scene)]
    order = np.argsort(roots)
    gaps = np.diff(np.concatenate([angles[:, order], angles[:, order[:1]] + 2.0 * np.pi], axis=1), axis=1)
    # Whole turns are those by which the gaps differ from those of the roots at the start.
    between = np.diff([*roots[order], roots[order[0]] + 2.0 * np.pi])
    gaps = gaps - 2.0 * np.pi * np.round((gaps[0] - between) / (2.0 * np.pi))
    row = first_row((gaps < 0.0).any(axis=1))
    return None if row is None else (row, "tips have changed their order around the hub")


def close(rows: Mapping[str, np.ndarray], scene: Scene) -> Finding:
    """A tip that comes close to another tether, after having been far."""
    if "smallest_tether_distance" not in rows:
        return None
    distance, shortest = rows["smallest_tether_distance"], np.min(scene.tethers.length)
    if "deployed_length" in rows:
        shortest = np.min(rows["deployed_length"], axis=1)
    near = distance < CLOSE * shortest
    row = first_row(near & ~near[0])
    if row is None:
        return None
    return row, f"a tip is {np.nanmin(distance[near]):.3g} m from another tether"
