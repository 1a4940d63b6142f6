"""Names of modes, derived from their shapes.

A mode belongs to the direction of the tethers, to the hub, or to the auxiliary tethers, whichever has the
largest share of its kinetic energy; the energy of auxiliary tethers is that of their motion relative to
the line between their ends. Its order
is the number of nodes along the tether, points at rest relative to the root: the k-th shape of a string has
k of them (Sturm). Around the circle it is a wave of number n that moves with the spin (forward) or against
it (backward).
"""

from typing import NamedTuple

import numpy as np

from esail_jax.array_types import Float
from esail_jax.modal.shapes import DIRECTIONS, Places, Shape

Host = np.ndarray

ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth")

LEAST = 1e-7
"""Displacements below this fraction of the largest one do not count as a change of sign."""

PURE = 0.75
"""A mode whose largest share of the kinetic energy is below this is called mixed."""

PRECESSION = 0.2
"""Largest difference between the frequency of a spin-axis precession and the spin rate, relative to the
latter. Seen from space, the precession is slower than this fraction of the spin."""


GROWING = 1e-7
"""Growth rates below this fraction of the frequency are rounding."""


RING = "auxiliary tethers"
"""Kind of a mode in which the auxiliary tethers move most."""

KINDS = (*DIRECTIONS, "hub", RING)
"""Kinds of modes, in the order of the shares of the kinetic energy."""


class Character(NamedTuple):
    """What a mode is: its kind (one of KINDS), the shares of the kinetic energy of all KINDS, the number of
    nodes along the tether or the auxiliary tether (-1 for the hub), and the direction (one of DIRECTIONS)
    in which it moves most (-1 for the hub)."""

    kind: str
    shares: Float[Host, "5"]
    nodes: int
    direction: int


def characters(shape: Shape, places: Places, copies: int) -> list[Character]:
    """The character of every mode. copies: number of tethers that each of the shape stands for."""
    count = shape.tether.shape[2]
    mass = places.mass[None, :, :count, None]
    energy = copies * (mass * np.abs(shape.tether) ** 2).sum((1, 2))
    hub = (places.hub[:, None] * np.abs(shape.hub) ** 2).sum(0)
    ring = np.zeros_like(energy)
    if shape.ring is not None:
        ring = copies * (places.ring.mass[None, :, :count, None] * np.abs(shape.ring) ** 2).sum((1, 2))
    shares = np.concatenate([energy, hub[None], ring.sum(0)[None]])
    shares /= shares.sum(0)
    of_modes = []
    for m, share in enumerate(shares.T):
        largest = int(share.argmax())
        kind = KINDS[largest]
        if kind == "hub":
            of_modes.append(Character(kind, share, -1, -1))
            continue
        moving = shape.ring if kind == RING else shape.tether
        direction = int(ring[:, m].argmax()) if kind == RING else largest
        line = strongest_line(moving[direction, :, :, m])
        of_modes.append(Character(kind, share, sign_changes(line), direction))
    return of_modes


def strongest_line(displacement: Host) -> Float[Host, " point"]:
    """The displacement of the tether that moves most, relative to its root, at the phase at which
    it is largest. displacement: (point, tether)."""
    relative = displacement - displacement[:1]
    line = relative[:, (np.abs(relative) ** 2).sum(0).argmax()]
    phase = np.sqrt((line**2).sum())
    return np.real(line * np.conj(phase) / max(abs(phase), 1e-300))


def sign_changes(line: Float[Host, " point"]) -> int:
    """The number of changes of sign."""
    signs = np.sign(line[np.abs(line) > LEAST * np.abs(line).max()])
    return int((np.diff(signs) != 0).sum())


def along_tether(character: Character) -> str:
    """The name of a tether's motion along its length, or of an auxiliary tether's."""
    kind, nodes = character.kind, character.nodes
    if kind == RING:
        way = DIRECTIONS[character.direction]
        motion = "axial (stretching)" if way == "axial" else f"{way} bending"
        name = f"{ordinal(nodes + 1)} {motion} of the {kind}"
    elif kind == "axial":
        name = f"{ordinal(nodes + 1)} axial (stretching)"
    elif nodes == 0:
        name = "in-plane swing (lagging)" if kind == "in-plane" else "out-of-plane swing (coning)"
    else:
        name = f"{ordinal(nodes)} {kind} bending"
    if character.shares.max() >= PURE:
        return name
    order = np.argsort(character.shares)[::-1][:2]
    parts = [f"{100 * character.shares[k]:.0f} % {KINDS[k]}" for k in order]
    return f"{name}, mixed ({', '.join(parts)})"


def ordinal(number: int) -> str:
    """The ordinal number in words, from the eleventh on in digits."""
    return ORDINALS[number - 1] if number <= len(ORDINALS) else f"{number}th"


def of_hub(hub: Host, inertia: Float[Host, "6"]) -> str:
    """The name of a mode in which the hub has most of the kinetic energy. hub: its six motions."""
    energy = inertia * np.abs(hub) ** 2
    parts = (energy[0], energy[1:3].sum(), energy[3], energy[4:].sum())
    names = (
        "hub heave (along the spin axis)",
        "hub sway (across the spin axis)",
        "hub twist (about the spin axis)",
        "hub wobble (tilt of the hub)",
    )
    return names[int(np.argmax(parts))]


def around_circle(n: int, count: int, forward: bool | None) -> str:
    """The part of a name that tells how the tethers move together. forward: None for standing."""
    if count == 1:
        return ""
    if n == 0:
        return ", collective"
    if 2 * n == count:
        return f", neighbours opposed (n = {n})"
    sense = "" if forward is None else ", forward" if forward else ", backward"
    return f", n = {n} around the circle{sense}"


def is_precession(character: Character, eigenvalue: complex, spin: float, backward: float) -> bool:
    """Tells whether a mode is the spin-axis precession: the whole sail tilts, and in space its axis moves
    slowly. backward: share of the hub's tilt that whirls against the spin."""
    near = abs(abs(eigenvalue.imag) - abs(spin)) < PRECESSION * abs(spin)
    return character.kind == "out-of-plane" and character.nodes == 0 and near and backward > 0.9


def backward_rotation(hub: Host, eigenvalue: complex, spin: float) -> float:
    """The share of the hub's tilt that whirls against the spin, of a motion u exp(s t)."""
    a, b = hub[4], hub[5]
    parts = np.abs([a - 1j * b, a + 1j * b]) ** 2
    if (eigenvalue.imag < 0.0) != (spin < 0.0):
        parts = parts[::-1]
    return float(parts[0] / max(parts.sum(), 1e-300))
