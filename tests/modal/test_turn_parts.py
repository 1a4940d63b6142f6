"""The parts of which Floquet multipliers are made: each against something exact, without integration."""

import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.equilibria.moving_frame import MovingFrame
from esail_jax.modal import floquet, periodic_orbit
from esail_jax.modal.floquet import multipliers, signed_wave, state_of
from esail_jax.modal.multipliers import FASTEST
from esail_jax.modal.periodic_orbit import Image, Orbit, Setting, run
from esail_jax.modal.sail_modes import assembled, solved_scene
from esail_jax.modal.turn_map import from_state, local, renumbered, settled, to_state
from esail_jax.numerics.angles import rotation_by
from support.sail_modes import RING, SPIN, built

pytestmark = pytest.mark.nightly

SMALL = {"tethers.count": 3, "tethers.elements": 1}
RINGS = SMALL | RING | {"auxiliary_tethers.length": 17322.0, "auxiliary_tethers.elements": 2}
"""Three tethers of one element, and auxiliary tethers with nodes of their own."""


def solved(name, overrides):
    """The table of modes, and what is needed of them."""
    scene = esail.load_scene(name, overrides)
    moving = solved_scene(scene, None)
    return assembled(scene, moving.found, None), moving


def steady(moving):
    """The state of a sail in its steady rotation."""
    q = moving.found.at.q
    v = MovingFrame(jnp.asarray(moving.axes[:, 0] * moving.found.spin), jnp.zeros(3)).turned(q)
    spin = abs(moving.found.spin)
    return run(settled, moving.system, spin, to_state(moving.system, spin, q, v))


def turned(system, z, rotation, places=0):
    """A state that is turned by a rotation and then renumbered."""
    x = (
        renumbered(system, part.rotate(rotation), places)
        for part in from_state(system, SPIN, jnp.asarray(z))
    )
    return np.asarray(to_state(system, SPIN, *x))


@pytest.fixture(scope="module")
def facing():
    return solved("sun-facing", SMALL)


def test_steady_sail_with_a_ring_looks_the_same_from_every_tether():
    """A steady sail of equal tethers that is turned by a third of a turn is the same sail with other
    numbers, its hub and the nodes of its auxiliary tethers included. 1e-11: rounding."""
    system, q, spin = built("sun-facing", RINGS)
    assert q.ring is not None
    z = run(settled, system, SPIN, to_state(system, SPIN, q, MovingFrame(spin, jnp.zeros(3)).turned(q)))
    axis = np.asarray(spin) / SPIN
    for places in (1, -1, 2):
        seen = turned(system, z, rotation_by(jnp.asarray(2.0 * np.pi / 3.0 * places * axis)), places)
        assert np.abs(seen - z).max() < 1e-11 * np.abs(z).max()


@pytest.mark.parametrize("spin", [SPIN, -SPIN])
def test_tethers_are_renumbered_in_the_sense_of_the_spin(monkeypatch, spin):
    """After its part of a turn the steady sail, renumbered as the map does it, stands where it stood,
    whichever way it spins."""
    kept = []

    def caught(setting, start):
        kept.append((setting, start))
        return periodic_orbit.unknown(setting, start, np.eye(1))

    monkeypatch.setattr(floquet, "periodic_orbit", caught)
    with pytest.raises(esail.SimulationError, match="No periodic orbit"):
        esail.modes("sun-facing", SMALL | {"initial.spin_rate": spin}, converge=False, floquet=True)
    setting, z = kept[0]
    assert setting.parts == 3 and setting.spin == SPIN
    momentum = run(local, setting.system, SPIN, jnp.asarray(z)).momentum
    angle = 2.0 * np.pi / setting.parts * momentum / np.linalg.norm(momentum)
    seen = turned(setting.system, z, rotation_by(jnp.asarray(angle)), setting.places)
    assert np.abs(seen - z).max() < 1e-11 * np.abs(z).max()  # rounding


def test_angular_momentum_turns_with_the_sail_and_grows_with_the_spin(facing):
    """In a rotation about e the angular momentum changes by e x H. A relative change of the spin changes it
    by H, as the whole sail rotates about n. Neither violates a constraint nor moves the centre of mass.
    1e-9: rounding of the equilibrium, which differs from a rotation by its Newton residual."""
    system = facing[1].system
    z = steady(facing[1])
    found = run(local, system, SPIN, jnp.asarray(z))
    size = np.linalg.norm(found.momentum)
    axis = found.momentum / size
    for e, turn in zip(np.eye(3), found.turns, strict=True):
        change = found.slopes @ turn
        assert np.abs(change - np.cross(e, found.momentum)).max() < 1e-9 * size
    faster = axis @ found.spins
    assert np.abs(found.slopes @ faster - found.momentum).max() < 1e-9 * size
    for change in (*found.turns, *found.spins):
        rows = np.abs(found.conditions) @ np.abs(change)
        assert np.abs(found.conditions @ change).max() < 1e-9 * rows.max()


def test_free_vibrations_have_no_angular_momentum():
    """Without wind the angular momentum is constant in space. A motion exp(s t) u as seen in B changes it,
    as seen in B, by exp(s t) h, so that h = 0 unless s is that of an axis at rest in space, +-i Omega.
    1e-6 of what its parts contribute: rounding of fast modes against the slow ones."""
    table, moving = solved("voltage-off", SMALL)
    found = run(local, moving.system, SPIN, jnp.asarray(steady(moving)))
    for mode, s in enumerate(table.eigenvalue):
        if np.abs(np.array([s - 1j * SPIN, s + 1j * SPIN])).min() > 1e-3 * SPIN:
            shape = state_of(table, moving, mode)
            parts = np.abs(found.slopes) @ np.abs(shape)
            assert np.abs(found.slopes @ shape).max() < 1e-6 * parts.max(), table.name[mode]


def test_multipliers_of_a_map_that_is_known(facing):
    """Facing the wind, a mode u exp(s t) of B is after a third of a turn exp(s T) u, turned with B and then
    renumbered. The map made of these images has the modes' eigenvalues for exponents, and with every image
    longer by exp(g T), the rate g more. 1e-8: rounding of the fastest motions, which are a thousand times
    faster than the slowest. Motions that decay by more than 1e-8 in the map have no multipliers."""
    table, moving = facing
    system, z = moving.system, steady(moving)
    held = run(local, system, SPIN, jnp.asarray(z))
    tangents = np.linalg.qr(held.conditions.T, mode="complete")[0][:, len(held.conditions) :]
    axis, duration, growth = moving.axes[:, 0], 2.0 * np.pi / (3.0 * SPIN), 0.01 * SPIN
    neutral = np.stack([axis @ held.turns, axis @ held.spins], axis=1)
    third = rotation_by(jnp.asarray(2.0 * np.pi / 3.0 * axis))
    shapes = np.stack([state_of(table, moving, k) for k in range(len(table))], axis=1)
    images = np.exp((table.eigenvalue + growth) * duration) * shapes

    def seen(image):
        whole = np.asarray(z)  # `from_state` is affine
        return turned(system, whole + image, third, 1) - turned(system, whole, third, 1)

    after = np.stack([seen(x.real) + 1j * seen(x.imag) for x in images.T], axis=1)
    given = tangents.T @ np.concatenate([shapes, shapes.conj(), neutral], axis=1)
    assert given.shape[0] == given.shape[1] and np.linalg.cond(given / np.linalg.norm(given, axis=0)) < 1e6
    wanted = tangents.T @ np.concatenate([after, after.conj(), neutral], axis=1)
    matrix = (wanted @ np.linalg.inv(given)).real
    orbit = Orbit(z, duration, 0.0, 0.0, 0.0, 0.0, tangents, matrix, neutral, 0.0, True)
    setting = Setting(system, SPIN, axis, 1, 1, 3)
    found = multipliers(table, moving, setting, orbit)
    slow = np.abs(table.eigenvalue) <= FASTEST * SPIN
    exponent = table.eigenvalue[slow] + growth
    assert np.abs(found.exponent[slow] - exponent).max() < 1e-8 * np.abs(exponent).max()
    assert np.abs(found.multiplier[slow] - np.exp(exponent * 3.0 * duration)).max() < 1e-6
    assert np.isnan(found.exponent[~slow]).all() and found.period == pytest.approx(2.0 * np.pi / SPIN)
    assert {signed_wave(table, int(k)) for k in np.flatnonzero(slow)} == {-1, 0, 1}
    fading = multipliers(table, moving, setting, orbit._replace(map=1e-9 * matrix))
    assert np.isnan(fading.multiplier).all() and np.isnan(fading.exponent).all()


def test_orbit_of_a_rigid_map_has_its_precession_and_drifts(monkeypatch, facing):
    """A map that turns the whole sail is known: by d about the wind, by a away from the wind, by Omega
    times what the duration differs from T, and that makes its spin faster by b. Newton's method finds T and
    d, and reports a and b as drifts of the sailing angle and of the spin. 1e-9: squares of a and b."""
    system, start = facing[1].system, np.asarray(steady(facing[1]))
    axis = facing[1].axes[:, 0]
    across = np.cross(axis, [0.0, 0.0, 1.0])
    wind = np.cos(0.2) * axis + np.sin(0.2) * across / np.linalg.norm(across)
    away = np.cross(wind, axis) / np.linalg.norm(np.cross(wind, axis))
    d, a, b, duration = 1e-4, 3e-6, 2e-6, 2.0 * np.pi / (3.0 * SPIN) * 1.0001

    def rigid(x, time, precession):
        rotation = rotation_by(jnp.asarray((d - precession) * wind))
        rotation = rotation @ rotation_by(jnp.asarray(a * away))
        rotation = rotation @ rotation_by(jnp.asarray(SPIN * (time - duration) * axis))
        return turned(system, x, rotation)

    def mapped(setting, z, time, precession, tangents):
        # Changes of the shape decay to 0.3, so that the sail at the start is the only fixed point.
        image = rigid(start + 0.3 * (z - start), time, precession)
        base = rigid(0.0 * start, time, precession)
        changes = [0.3 * (rigid(x, time, precession) - base) for x in tangents.T]
        faster = np.concatenate([np.zeros(len(z) // 2), b * image[len(z) // 2 :]])
        h = 1e-3 / SPIN
        rate = (rigid(z, time + h, precession) - rigid(z, time - h, precession)) / (2.0 * h)
        return Image(image + faster, rate, np.stack(changes, axis=1))

    monkeypatch.setattr(periodic_orbit, "mapped", mapped)
    orbit = periodic_orbit.periodic_orbit(Setting(system, SPIN, wind, 1, 1, 3), start)
    assert orbit.converged and abs(orbit.sailing_angle - 0.2) < 1e-9
    found = np.array([orbit.precession, orbit.tilt, orbit.spin, orbit.duration / duration - 1.0])
    assert np.abs(found - [d, a, b, 0.0]).max() < 1e-9 and orbit.left < 1e-9
