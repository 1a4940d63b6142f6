"""The moving picture of a sail."""

import dataclasses

import numpy as np

from esail_jax.constants import ASTRONOMICAL_UNIT
from esail_jax.files.reading import SavedRun
from esail_jax.scenes.hub import azimuths, root_positions
from esail_jax.scenes.scene import released
from esail_jax.viewing.motion import Motion, Quantity, chosen_exaggeration
from esail_jax.viewing.signals import signals_of

POINTS = 7
"""Number of vertices of a tether whose nodes the run file does not hold."""

YAW, PITCH = np.radians(-62.0), np.radians(16.0)
"""First direction of view, from that along the spin axis: from the side, so that coning is visible, but not
in the plane of the sail."""

MARGIN = 1.1
"""The picture's radius, as a multiple of the longest tether's reach."""

NODES = "node_position_I"
"""Observable with the positions of all nodes, which a file has if the run was asked for it."""

SHAPES = {
    "nodes": "tethers: straight lines between their nodes",
    "slope": "tethers: parabola from the direction at the root to the tip",
    "straight": "tethers: straight lines from root to tip",
}
"""How tethers are drawn: from all their nodes, from the angles at the root, or from the tips alone."""

RING_SHAPE = "; auxiliary tethers: straight lines between tips"
"""How auxiliary tethers are drawn: a run file holds their ends only, the tips."""


def sail_motion(run: SavedRun, frames: np.ndarray) -> Motion:
    """The moving picture of a sail at these saved instants. Raises RunFileError if the file lacks
    the positions of the tips or the attitude."""
    scene, rows = run.scene, run.rows
    run.need("tip_position_I", "rotation_IB", *(["hub_position_I"] if scene.hub is not None else []))
    rotation = rows["rotation_IB"][frames]
    centre = rows["hub_position_I"][frames] if scene.hub is not None else np.zeros((len(frames), 3))
    count = scene.tethers.count

    def to_body(positions: np.ndarray) -> np.ndarray:
        from_hub = positions.reshape(len(frames), -1, 3) - centre[:, None]
        return (from_hub @ rotation).reshape(positions.shape)

    tips = to_body(rows["tip_position_I"][frames])
    roots, directions = root_positions(scene.hub, count).T, outward(azimuths(scene.hub, count))
    free = released(scene, run.time[frames])
    if NODES in rows:
        shape, lines = "nodes", to_body(rows[NODES][frames])
    elif {"root_coning_angle", "root_lagging_angle"} <= rows.keys():
        coning, lagging = (rows[name][frames] for name in ("root_coning_angle", "root_lagging_angle"))
        shape, lines = "slope", parabolas(roots, tips, root_directions(coning, lagging, directions))
    else:
        shape = "straight"
        lines = np.stack([np.broadcast_to(roots, tips.shape), tips], axis=2)
    if shape != "nodes":  # where the root of a released tether is, the file does not say
        lines[free, :-1] = np.nan
    points = lines.shape[2]
    vertices = lines.reshape(len(frames), count * points, 3)
    straight = np.repeat(directions, points, axis=0)
    held = np.where(free[..., None, None], np.nan, lines).reshape(vertices.shape)
    reach = float(np.linalg.norm(roots, axis=1).max())
    reach += float(np.max(rows.get("deployed_length", scene.tethers.length)))
    ends = tuple(i * points + points - 1 for i in range(count))
    return Motion(
        title=run.name,
        model=model_of(run),
        frames=frames,
        saved=len(run.time),
        time=run.time[frames],
        vertices=vertices,
        lines=(
            *(tuple(range(i * points, (i + 1) * points)) for i in range(count)),
            *(ring_lines(ends) if scene.auxiliary_tethers is not None else ()),
        ),
        markers=ends,
        released=tuple(int(np.argmax(one)) if one.any() else None for one in free.T),
        straight=straight,
        rotation=rotation,
        wind=wind_directions(run, frames, centre),
        basis=first_basis(rotation[0]),
        middle=np.zeros(3),
        radius=MARGIN * reach,
        yaw=YAW,
        pitch=PITCH,
        exaggeration=chosen_exaggeration(held, straight),
        period=spin_period(float(scene.initial.spin_rate)),
        reach=reach,
        anchor=np.zeros(3),
        shape=SHAPES[shape] + (RING_SHAPE if scene.auxiliary_tethers is not None else ""),
        colours={name: without(quantity, free) for name, quantity in line_colours(run, frames).items()},
        signals=signals_of(run, frames),
    )


def outward(azimuth: np.ndarray) -> np.ndarray:
    """The unit vectors (tether, 3) in B from the spin axis to roots at these azimuths [rad]."""
    return np.stack([0.0 * azimuth, np.cos(azimuth), np.sin(azimuth)], axis=1)


def root_directions(coning: np.ndarray, lagging: np.ndarray, radial: np.ndarray) -> np.ndarray:
    """The unit vectors (time, tether, 3) in B along the tethers at their roots, from the root
    angles (time, tether) [rad] ([PGV] Eq. 60-61). radial: unit vectors (tether, 3) in B from the axis to
    the roots."""
    sideways = np.cross([1.0, 0.0, 0.0], radial)
    flat = np.cos(lagging)[..., None] * radial + np.sin(lagging)[..., None] * sideways
    return np.sin(coning)[..., None] * [1.0, 0.0, 0.0] + np.cos(coning)[..., None] * flat


def parabolas(roots: np.ndarray, tips: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Points (time, tether, point, 3) of parabolas from the roots (tether, 3) to the tips
    (time, tether, 3) that begin in the directions (time, tether, 3).

    r(s) = r_0 + s l d + s^2 (c - l d), 0 <= s <= 1, with the chord c and its length l. That is the shape of
    a string of constant tension under a uniform load."""
    chord = tips - roots
    start = np.linalg.norm(chord, axis=-1, keepdims=True) * directions
    s = np.linspace(0.0, 1.0, POINTS)[:, None]
    return roots[:, None] + s * start[..., None, :] + s**2 * (chord - start)[..., None, :]


def wind_directions(run: SavedRun, frames: np.ndarray, centre: np.ndarray) -> np.ndarray | None:
    """The direction of the wind at the hub in inertial axes (frame, 3); None without wind."""
    if run.scene.solar_wind is None:
        return None
    if "heliocentric_position" in run.rows:
        sun = run.rows["heliocentric_position"][frames]
    elif run.scene.orbit is not None:
        return None  # the saved rows do not tell where the sail is
    else:
        sun = np.asarray(run.scene.initial.heliocentric_position_au, float) * ASTRONOMICAL_UNIT + centre
    return sun / np.linalg.norm(sun, axis=-1, keepdims=True)


def first_basis(rotation: np.ndarray) -> np.ndarray:
    """The axes of the first view (3, 3): towards the viewer along the spin axis X_B at the start,
    upwards as close as possible to Z_I (to Y_I where the spin axis is close to Z_I)."""
    normal = rotation[:, 0]
    other = np.array([0.0, 0.0, 1.0]) if abs(normal[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    up = other - (other @ normal) * normal
    up /= np.linalg.norm(up)
    return np.stack([np.cross(up, normal), up, normal])


def spin_period(rate: float) -> float | None:
    """The spin period [s]; None without spin."""
    return 2.0 * np.pi / abs(rate) if rate else None


def model_of(run: SavedRun) -> str:
    """What the sail consists of, in words."""
    tethers = run.scene.tethers
    ring = ", tips joined by auxiliary tethers" if run.scene.auxiliary_tethers is not None else ""
    return f"{tethers.count} tethers, {tethers.elements} {tethers.element} elements each{ring}"


def ring_lines(ends: tuple[int, ...]) -> tuple[tuple[int, int], ...]:
    """The lines of the auxiliary tethers, from each tip to the next one. ends: vertices of the
    tips."""
    return tuple(zip(ends, ends[1:] + ends[:1], strict=True))


def line_colours(run: SavedRun, frames: np.ndarray) -> dict[str, Quantity]:
    """The quantities by which the lines may be coloured, as far as the file holds them: those of
    the tethers, and of the auxiliary tethers the tension."""
    rows, quantities = run.rows, {}
    if "reaction_B" in rows:
        tension = np.linalg.norm(rows["reaction_B"][frames], axis=-1)
        label = "tension at the root"
        if "auxiliary_tension" in rows:
            label = "tension (of tethers at the root)"
        quantities["tension"] = Quantity(label, "N", with_ring(run, frames, tension, "auxiliary_tension"))
    if "voltage" in rows:
        quantities["voltage"] = Quantity("voltage", "V", with_ring(run, frames, rows["voltage"][frames]))
    if "max_axial_strain" in rows:
        strain = with_ring(run, frames, rows["max_axial_strain"][frames])
        quantities["strain"] = Quantity("largest strain", "-", strain)
    return quantities


def without(quantity: Quantity, free: np.ndarray) -> Quantity:
    """A quantity without its values of released tethers (frame, tether): such a tether has no
    colour, and the range of the colours is that of the others."""
    values = np.array(quantity.values, float)
    values[:, : free.shape[1]][free] = np.nan
    return dataclasses.replace(quantity, values=values)


def with_ring(
    run: SavedRun, frames: np.ndarray, values: np.ndarray, of_ring: str | None = None
) -> np.ndarray:
    """The values (frame, line) of the tethers, followed by those of the auxiliary tethers if the
    sail has any. of_ring: name of their observable; where it is not known they have no colour, NaN."""
    if run.scene.auxiliary_tethers is None:
        return values
    ring = run.rows[of_ring][frames] if of_ring in run.rows else np.full(values.shape, np.nan)
    return np.concatenate([values, ring], axis=1)
