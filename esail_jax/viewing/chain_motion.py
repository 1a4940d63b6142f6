"""The moving picture of a chain of rods."""

import numpy as np

from esail_jax.files.reading import SavedRun
from esail_jax.viewing.motion import Motion, Quantity, chosen_exaggeration
from esail_jax.viewing.signals import signals_of

PITCH = np.radians(10.0)
"""First direction of view: from slightly above the plane in which the chain extends most."""

SHAPE = "straight rods between the joints"

SMALL = 1e-9
"""Extents below this part of the largest are rounding."""


def chain_motion(run: SavedRun, frames: np.ndarray) -> Motion:
    """The moving picture of a chain at these saved instants. Raises RunFileError if the file lacks
    the positions of the joints."""
    run.need("joint_position")
    scene = run.scene
    joints = run.rows["joint_position"]
    low, high = joints.min((0, 1)), joints.max((0, 1))
    free = scene.chain.anchor == "free"
    origin = (low + high) / 2.0 if free else np.zeros(3)
    vertices = joints[frames] - origin
    straight = np.broadcast_to(mean_direction(joints), (scene.chain.rods + 1, 3))
    middle = (low + high) / 2.0 - origin
    radius = np.linalg.norm(joints - origin - middle, axis=-1).max()
    colours = {}
    if "tension" in run.rows:
        colours["tension"] = Quantity("tension", "N", run.rows["tension"][frames])
    length = np.linalg.norm(np.diff(joints[frames], axis=1), axis=-1)
    undeformed = np.broadcast_to(np.asarray(scene.chain.length, float), (scene.chain.rods,))
    if "deployed_length" in run.rows:
        undeformed = run.rows["deployed_length"][frames, None] * undeformed / undeformed.sum()
    strain = length / undeformed - 1.0
    colours["strain"] = Quantity("elongation of a rod over its length", "-", strain)
    return Motion(
        title=run.name,
        model=f"{scene.chain.rods} rods, {scene.chain.anchor} chain",
        frames=frames,
        saved=len(run.time),
        time=run.time[frames],
        vertices=vertices,
        lines=tuple((k, k + 1) for k in range(scene.chain.rods)),
        markers=(0, scene.chain.rods) if free else (scene.chain.rods,),
        released=(),
        straight=straight,
        rotation=None,
        wind=None,
        basis=first_basis(run),
        middle=middle,
        radius=float(radius),
        yaw=0.0,
        pitch=PITCH,
        exaggeration=chosen_exaggeration(vertices, straight),
        period=None,
        reach=None,
        anchor=None if free else np.zeros(3),
        shape=SHAPE,
        colours=colours,
        signals=signals_of(run, frames),
    )


def mean_direction(joints: np.ndarray) -> np.ndarray:
    """The unit vector (3) along the mean over time of the line from the first joint to the last of
    joints (time, joint, 3)."""
    chords = joints[:, -1] - joints[:, 0]
    chords = chords / np.maximum(np.linalg.norm(chords, axis=-1, keepdims=True), np.finfo(float).tiny)
    mean = chords.mean(0)
    size = np.linalg.norm(mean)
    return mean / size if size > 0.0 else np.array([1.0, 0.0, 0.0])


def first_basis(run: SavedRun) -> np.ndarray:
    """The axes of the first view (3, 3): upwards against gravity, on an orbit away from the centre
    of attraction, otherwise along the axis x, y or z against which the chain hangs; to the right along the
    axis in which the joints then extend most."""
    joints, scene = run.rows["joint_position"], run.scene
    up = np.array([1.0, 0.0, 0.0]) if scene.orbit is not None else -mean_direction(joints)
    if scene.gravity is not None:
        gravity = np.asarray(scene.gravity.acceleration, float)
        up = -gravity if np.linalg.norm(gravity) > 0.0 else up
    up = up / np.linalg.norm(up)
    extent = np.ptp(joints.reshape(-1, 3), axis=0)
    axes = np.eye(3) - np.outer(up, up)
    right = axes[np.argmax((extent + SMALL * extent.max()) * np.linalg.norm(axes, axis=1))]
    right = right / np.linalg.norm(right)
    return np.stack([right, up, np.cross(right, up)])
