"""Rotations between ecliptic and equator: against SPICE's own, and against the standard's example."""

from decimal import Decimal, localcontext

import numpy as np
import spiceypy
from scipy.spatial.transform import Rotation

from esail_jax.calendar.frames import (
    TO_EQUATOR,
    attitude_to_equatorial,
    quaternions,
    to_ecliptic,
    to_equatorial,
)

RNG = np.random.default_rng(61)
PI = Decimal("3.14159265358979323846264338327950288419716939937511")


def series(angle, first):
    """The series of the sine (first = 1) or the cosine (first = 0), to 40 digits."""
    term = angle if first else Decimal(1)
    total, n = term, first
    while abs(term) > Decimal(10) ** -45:
        term *= -angle * angle / ((n + 1) * (n + 2))
        total, n = total + term, n + 2
    return total


def test_the_rotation_is_that_of_the_obliquity_to_forty_digits():
    with localcontext(prec=50):
        angle = Decimal("84381.448") / 3600 * PI / 180
        sine, cosine = series(angle, 1), series(angle, 0)
        assert abs(sine**2 + cosine**2 - 1) < Decimal(10) ** -40
        exact = [[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]]
        errors = [abs(Decimal(float(TO_EQUATOR[i, j])) - exact[i][j]) for i in range(3) for j in range(3)]
    assert max(errors) < 1e-15


def test_the_rotation_is_that_of_spice():
    assert np.abs(TO_EQUATOR - spiceypy.pxform("ECLIPJ2000", "J2000", 0.0)).max() < 1e-15


def test_vectors_turn_there_and_back():
    """The pole of the ecliptic leans from that of the equator to negative Y."""
    vectors = RNG.normal(size=(5, 4, 3))
    assert np.abs(to_ecliptic(to_equatorial(vectors)) - vectors).max() < 1e-15
    pole = to_equatorial(np.array([0.0, 0.0, 1.0]))
    assert pole[0] == 0.0 and pole[1] < 0.0 and pole[2] > 0.9
    matrix = spiceypy.pxform("ECLIPJ2000", "J2000", 0.0)
    assert np.abs(to_equatorial(vectors[0, 0]) - matrix @ vectors[0, 0]).max() < 1e-15


def test_an_attitude_maps_axes_of_the_body_to_the_equator():
    rotation = Rotation.random(6, rng=RNG).as_matrix()
    body = RNG.normal(size=3)
    assert np.abs(attitude_to_equatorial(rotation) @ body - to_equatorial(rotation @ body)).max() < 1e-15


def test_the_quaternion_is_that_of_the_standard():
    """CCSDS 504.0-B-2, F2: frame B is A turned by +90 deg about Z, so that X_A has the components
    (0, -1, 0) in B."""
    to_b = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert np.array_equal(to_b @ [1.0, 0.0, 0.0], [0.0, -1.0, 0.0])
    half = np.sqrt(0.5)
    assert np.abs(quaternions(to_b.T[None])[0] - [0.0, 0.0, half, half]).max() < 1e-15


def test_quaternions_are_those_of_spice():
    """Turns by all angles, half turns about every axis among them, to rounding."""
    axes = np.concatenate([RNG.normal(size=(300, 3)), np.eye(3), [[1.0, 1.0, 0.0], [-1.0, 1.0, 1e-9]]])
    angles = np.concatenate([RNG.uniform(-np.pi, np.pi, 300), np.full(5, np.pi)])
    turns = Rotation.from_rotvec(axes / np.linalg.norm(axes, axis=1, keepdims=True) * angles[:, None])
    for matrix in turns.as_matrix():
        found = quaternions(matrix[None])[0]
        known = np.roll(spiceypy.m2q(matrix), -1)
        assert np.abs(found - known * np.copysign(1.0, known @ found)).max() < 2e-15
        assert found[3] >= 0.0


def test_the_sign_of_a_series_is_continuous():
    """Over two turns the quaternion goes to its negative and back."""
    angles = np.linspace(0.0, 4.0 * np.pi, 41)
    axis = np.array([0.6, 0.0, 0.8])
    found = quaternions(Rotation.from_rotvec(angles[:, None] * axis).as_matrix())
    known = np.column_stack([np.sin(angles / 2.0)[:, None] * axis, np.cos(angles / 2.0)])
    assert np.abs(found - known).max() < 1e-14
