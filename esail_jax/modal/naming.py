"""Modes with their names, from the vibrations of a group and their shapes."""

from typing import NamedTuple

import numpy as np

from esail_jax.modal import names
from esail_jax.modal.selection import Vibration
from esail_jax.modal.shapes import Places, Shape, shape_of
from esail_jax.modal.solving import Motions
from esail_jax.system import System

Host = np.ndarray

MAINLY = 0.6
"""Share of the motion from which a mode of unequal tethers is named after one wave or one tether."""


class NamedMode(NamedTuple):
    """A mode of a group. n: wave number, -1 for unequal tethers; motion: its column in the group;
    conjugate: whether its shape is the conjugate of that column."""

    natural_frequency: float
    damping_ratio: float
    eigenvalue: complex
    name: str
    n: int
    kind: str
    nodes: int
    motion: int
    conjugate: bool


def named_group(
    system: System, group: Motions, places: Places, spin: float, known: dict[int, Shape]
) -> list[NamedMode]:
    """The modes of a group. known: shapes of the groups so far, by the identity of their motions,
    which several wave numbers may share."""
    shapes, count = group.shapes, system.tethers.count
    shape = known.get(id(shapes.local))
    if shape is None:
        shape = known[id(shapes.local)] = shape_of(system, places, shapes.local, shapes.hub, shapes.n)
    copies = 1 if shapes.n is None else count
    every = names.characters(shape, places, copies)
    modes = []
    for vibration in group.vibrations:
        k = vibration.motion
        character = every[k]
        hub, value = shape.hub[:, k], vibration.eigenvalue
        conjugate = vibration.wave < 0
        turning = names.backward_rotation(hub.conj() if conjugate else hub, value, spin)
        if system.hub is not None and names.is_precession(character, value, spin, turning):
            name = "spin-axis precession (tilt of the whole sail)"
        else:
            name = plain_name(character, hub, places)
            if shapes.n is None:
                name += among_unequal(character, shape, k, value, spin)
            else:
                name += names.around_circle(shapes.n, count, forward_of(vibration, spin))
        if vibration.damping_ratio >= 1.0:
            name += ", overdamped"
        elif value.real > names.GROWING * abs(value):
            name += ", growing"
        n = -1 if shapes.n is None else shapes.n
        modes.append(
            NamedMode(
                vibration.natural_frequency,
                vibration.damping_ratio,
                value,
                name,
                n,
                character.kind,
                character.nodes,
                vibration.motion,
                conjugate,
            )
        )
    return modes


def plain_name(character: names.Character, hub: Host, places: Places) -> str:
    """The name of a motion, whatever its form around the circle."""
    if character.kind == "hub":
        return names.of_hub(hub, places.hub)
    return names.along_tether(character)


def forward_of(vibration: Vibration, spin: float) -> bool | None:
    """Tells whether a wave exp(i n phi + s t) moves with the spin; None for a standing one."""
    return None if vibration.wave == 0 else (vibration.wave < 0) == (spin > 0.0)


def among_unequal(character: names.Character, shape: Shape, k: int, value: complex, spin: float) -> str:
    """The part of a name that tells which of the unequal tethers move in mode k, and how."""
    count = shape.tether.shape[2]
    if count == 1 or character.kind == "hub":
        return ""
    moving = shape.ring if character.kind == names.RING else shape.tether
    line = moving[character.direction, :, :, k]
    line = line - line[:1]
    energy = (np.abs(line) ** 2).sum(0)
    strongest = int(energy.argmax())
    if energy[strongest] > MAINLY * energy.sum():
        return f", mostly {'segment' if character.kind == names.RING else 'tether'} {strongest + 1}"
    amplitude = (line * line[:, strongest : strongest + 1].conj()).sum(0)
    amplitude /= np.sqrt(np.maximum(energy, 1e-300 + 1e-12 * energy.max()))
    waves = np.abs(np.fft.fft(amplitude)) ** 2
    both = {n: waves[n] + (waves[-n] if 0 < 2 * n < count else 0.0) for n in range(count // 2 + 1)}
    n = max(both, key=lambda n: both[n])
    if both[n] < MAINLY * waves.sum():
        return ", several tethers"
    if not 0 < 2 * n < count or value.imag == 0.0:
        return names.around_circle(n, count, None).replace(", ", ", mainly ", 1)
    share = waves[n] / both[n]
    forward = None if 1.0 - MAINLY < share < MAINLY else bool((share < 0.5) == (spin > 0.0))
    return names.around_circle(n, count, forward).replace(", ", ", mainly ", 1)
