"""The physics of one point and of one element against closed forms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from esail_jax.elements.axial import AxialDissipation, AxialEnergy, axial_strain
from esail_jax.elements.bending import BendingDissipation, BendingEnergy, curvature_squared
from esail_jax.elements.rigid_body import RigidBody
from esail_jax.elements.tether import TetherBatch
from esail_jax.numerics.vectors import dot
from esail_jax.point_fields import PointFields, invariants_of
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.structure import split
from support.quick import build_jitted, jit


def rotation(seed=1):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return jnp.asarray(q * np.sign(np.linalg.det(q)))


def random_fields(seed=2, shape=(4, 3, 2)):
    rng = np.random.default_rng(seed)
    draw = lambda scale: jnp.asarray(scale * rng.normal(size=(3, *shape)))  # noqa: E731
    along = jnp.asarray(np.array([1.0, 0.2, -0.3]).reshape(3, 1, 1, 1))
    return PointFields(draw(10.0), along + draw(0.1), draw(0.05))


TERMS = {
    "axial": AxialEnergy(jnp.array([3.0, 5.0]), "green-lagrange"),
    "axial engineering": AxialEnergy(jnp.array([3.0, 5.0]), "engineering"),
    "bending": BendingEnergy(jnp.array([0.7, 0.2])),
}
DISSIPATIONS = {
    "axial": AxialDissipation(jnp.array([3.0, 5.0]), jnp.array([0.5, 2.0]), "green-lagrange"),
    "bending": BendingDissipation(jnp.array([0.7, 0.2]), jnp.ones(2), jnp.full(2, 1e-3)),
}


@pytest.mark.parametrize("name", TERMS)
def test_energy_density_does_not_see_rotation(name):
    """The energy density is objective: W(R r_x, R r_xx) = W(r_x, r_xx)."""
    fields, turn = random_fields(), rotation()
    turned = jax.tree.map(lambda x: jnp.tensordot(turn, x, 1), fields)
    np.testing.assert_allclose(TERMS[name].density(turned), TERMS[name].density(fields), rtol=1e-12)


@pytest.mark.parametrize("name", DISSIPATIONS)
def test_rigid_rotation_dissipates_nothing(name):
    """A bent, stretched cable with the rates omega x r_x and omega x r_xx dissipates nothing and has no
    force."""
    fields, omega = random_fields(), jnp.array([0.3, -1.1, 0.7])
    spun = jax.tree.map(
        lambda x: jnp.cross(jnp.broadcast_to(omega.reshape(3, 1, 1, 1), x.shape), x, axis=0), fields
    )
    scale = DISSIPATIONS[name].density(fields, random_fields(5)).max()
    assert DISSIPATIONS[name].density(fields, spun).max() < 1e-28 * max(1.0, float(scale))


def test_axial_stress_is_the_derivative_printed_as_equation_86():
    """Automatic differentiation gives n = EA eps r_x for the Green-Lagrange strain ([PGV] Eq. 86)."""
    fields, term = random_fields(), TERMS["axial"]
    stress = term.point_forces(jnp.zeros(()), fields, fields).r_x
    expected = term.stiffness * axial_strain(dot(fields.r_x, fields.r_x), "green-lagrange") * fields.r_x
    np.testing.assert_allclose(stress, expected, rtol=1e-13)


def test_strain_measures_of_a_uniform_stretch():
    """|r_x| = 1.1 has a Green-Lagrange strain of 0.105 and an engineering strain of 0.1."""
    squared = jnp.asarray(1.1**2)
    np.testing.assert_allclose(axial_strain(squared, "green-lagrange"), 0.105, rtol=1e-13)
    np.testing.assert_allclose(axial_strain(squared, "engineering"), 0.1, rtol=1e-12)


def test_curvature_of_a_circle_is_one_over_its_radius_however_it_is_stretched():
    """r = R (cos(s x / R), sin(s x / R)) has the curvature 1/R for any stretch s = |r_x|."""
    radius, speed = 7.0, 1.3
    r_x, r_xx = jnp.array([0.0, speed, 0.0]), jnp.array([-(speed**2) / radius, 0.0, 0.0])

    def found(r_xx):
        return curvature_squared(invariants_of(PointFields(None, r_x, r_xx)))

    np.testing.assert_allclose(found(r_xx), 1.0 / radius**2, rtol=1e-13)
    # r_xx along the tangent is stretching, not bending.
    np.testing.assert_allclose(found(r_xx + 0.4 * r_x), 1.0 / radius**2, rtol=1e-12)


def test_bending_dissipation_is_smooth_when_straight_and_the_printed_law_when_bent():
    """The regularised bending dissipation is smooth at zero curvature.

    At kappa = 0 the force is zero and its tangent is finite. For kappa >> kappa_0 the density is
    gamma EI kappa'^2 / 2 ([PGV] Eq. 36), up to a relative difference of (kappa_0/kappa)^2.
    """
    term = BendingDissipation(jnp.array([2.0]), jnp.array([1.5]), jnp.array([1e-3]))
    tangent = jnp.array([[1.0], [0.0], [0.0]])
    straight = PointFields(None, tangent, jnp.zeros((3, 1)))
    bending_rate = PointFields(None, jnp.zeros((3, 1)), jnp.array([[0.0], [0.2], [0.0]]))

    def force(fields):
        return term.point_forces(jnp.zeros(()), fields, bending_rate).r_xx

    assert np.all(np.asarray(jit(force)(straight)) == 0.0)
    jacobian = jit(jax.jacfwd(lambda x: force(straight._replace(r_xx=x))))(jnp.zeros((3, 1)))
    assert np.all(np.isfinite(jacobian))
    kappa = 0.1
    bent = straight._replace(r_xx=jnp.array([[0.0], [kappa], [0.0]]))
    expected = 0.5 * 1.5 * 2.0 * 0.2**2
    found = term.density(bent, bending_rate)[0]
    np.testing.assert_allclose(found, expected / (1 + (1e-3 / kappa) ** 2), rtol=1e-12)


def tethers(kind="cable", elements=3):
    return TetherBatch(
        element_length=jnp.array([2.0, 3.0]),
        line_density=jnp.array([0.5, 0.25]),
        tip_mass=jnp.array([1.0, 0.0]),
        elements=elements,
        kind=kind,
        fields_used=("r", "r_x", "r_xx") if kind == "cable" else ("r", "r_x"),
    )


@pytest.mark.parametrize("kind", ["cable", "truss"])
def test_mass_matrix_holds_mass_and_moment_of_inertia(kind):
    """Translation gives the total mass, rotation of a straight tether about its root rho L^3/3 + m L^2."""
    chain = tethers(kind)
    mass = np.asarray(chain.line_density * chain.element_length * 3 + chain.tip_mass)
    moved = chain.inertia(chain.uniform(jnp.array([0.0, 1.0, 0.0])))
    np.testing.assert_allclose(moved[0, 1].sum(0), mass, rtol=1e-13)
    distance = jnp.arange(4.0)[:, None] * chain.element_length
    spin = jnp.zeros((chain.coefs, 3, 4, 2)).at[0, 1].set(distance)
    spin = spin.at[1, 1].set(1.0) if kind == "cable" else spin
    length = 3 * np.asarray(chain.element_length)
    expected = np.asarray(chain.line_density) * length**3 / 3 + np.asarray(chain.tip_mass) * length**2
    np.testing.assert_allclose((spin * chain.inertia(spin)).sum((0, 1, 2)), expected, rtol=1e-13)


def test_interpolation_and_nodal_forces_are_transposes():
    """The virtual work f . (S q), summed over points, equals q . (nodal forces of f) for all fields
    together."""
    chain, rng = tethers(), np.random.default_rng(3)
    q = jnp.asarray(rng.normal(size=(2, 3, 4, 2)))
    f = jax.tree.map(lambda x: jnp.asarray(rng.normal(size=x.shape)), chain.interpolate(q))
    at_points = sum((a * b).sum(0) for a, b in zip(f, chain.interpolate(q), strict=True))
    work = (chain.weights[:, None] * at_points * chain.lengths).sum()
    np.testing.assert_allclose((q * chain.nodal_forces(f)).sum(), work, rtol=1e-12)


def test_hub_mass_matrix_is_a_cylinder():
    """Translation gives m, rotation about X_B gives m R^2/2, and about Y_B m (3 R^2 + h^2)/12."""
    hub = RigidBody(jnp.asarray(2.0), jnp.asarray(1.5), jnp.asarray(100.0))
    mass = 100.0 * np.pi * 1.5**2 * 2.0
    points = hub.base_points
    for axis, moment in (
        ([1.0, 0.0, 0.0], mass * 1.5**2 / 2),
        ([0.0, 1.0, 0.0], mass * (3 * 1.5**2 + 2.0**2) / 12),
    ):
        v = jnp.cross(jnp.asarray(axis), points)
        np.testing.assert_allclose((v * (hub.mass_matrix @ v)).sum(), moment, rtol=1e-12)
    np.testing.assert_allclose(hub.mass_matrix.sum(), mass, rtol=1e-12)


def test_hub_constraints_are_distances_and_vanish_for_rigid_motion():
    """Phi = 0 for any position and attitude of the hub; a point moved outwards by 1 um gives 1 um."""
    hub = RigidBody(jnp.asarray(2.0), jnp.asarray(1.0), jnp.asarray(100.0))
    placed = hub.base_points @ rotation().T + jnp.array([100.0, -20.0, 3.0])
    assert np.abs(hub.constraints(placed)).max() < 1e-13
    stretched = hub.base_points.at[1, 0].add(1e-6)
    np.testing.assert_allclose(hub.constraints(stretched)[0], 1e-6, rtol=1e-5)
    np.testing.assert_allclose(hub.rotation(placed), rotation(), atol=1e-13)


def test_angular_velocity_of_a_turning_hub():
    """Points that move with omega x r have the body components of omega as angular velocity."""
    hub = RigidBody(jnp.asarray(2.0), jnp.asarray(1.0), jnp.asarray(100.0))
    points, omega = hub.base_points @ rotation().T, jnp.array([0.1, -0.2, 0.05])
    found = hub.angular_velocity(points, jnp.cross(omega, points) + 3.0)
    np.testing.assert_allclose(found, rotation().T @ omega, atol=1e-14)


@pytest.mark.parametrize("element, count", [("cable", 5), ("truss", 40)])
def test_steady_elongation_matches_the_continuous_cable(element, count):
    """The steady elongation is the integral of N/EA over the tether, for small strain.

    N(x) = omega^2 (m (R+L) + rho A ((R+L)^2 - (R+x)^2)/2). Second-order effects of the strain are 1e-3 of
    the elongation; the truss's discretisation error is smaller.
    """
    changes = {"tethers.elements": count, "tethers.count": 1, "tethers.bending": False}
    changes |= {"tethers.element": element, "hub.radius": 30.0}
    scene = load_scene("truss" if element == "truss" else "baseline").replace(changes)
    model = build_jitted(*split(scene))
    length, radius, spin, ea = 10e3, 30.0, 4e-3, 70e9 * 4.28e-9
    rho, tip = 7653.0 * 4.28e-9, 1.5
    outer = radius + length
    stretch = tip * outer * length + rho * (outer**2 * length - (outer**3 - radius**3) / 3) / 2
    expected = spin**2 * stretch / ea
    found = jnp.linalg.norm(model.q.tether[0, :, -1, 0] - model.q.tether[0, :, 0, 0]) - length
    np.testing.assert_allclose(found, expected, rtol=3e-3)
    assert model.unbalanced.max() < 1e-9


def test_printed_elongation_is_equation_79():
    """Tip position and slope are those of [PGV] Eq. 79 as printed, with the tether's own mass at the
    tip."""
    model = build_jitted(*split(load_scene("baseline").replace({"initial.elongation": "paper"})))
    modulus, area, length, rho, spin = 70e9, 4.28e-9, 10e3, 7653.0, 4e-3
    tip = rho * area * length * spin**2 * length / (modulus * area)
    r = 1.0 + length
    position = (1 + rho * spin**2 / (6 * modulus) * (3 * length**2 - r**2) + tip) * r
    slope = 1 + rho * spin**2 / (2 * modulus) * (length**2 - r**2) + tip
    np.testing.assert_allclose(jnp.linalg.norm(model.q.tether[0, :, -1, 0]), position, rtol=1e-14)
    np.testing.assert_allclose(jnp.linalg.norm(model.q.tether[1, :, -1, 0]), slope, rtol=1e-14)
