"""Rigid hub in natural coordinates: four base points and six rigidity constraints ([PGV] Sec. 2.3, App. B).

The base points in the body frame, whose origin is the hub centre, are A = (-h/2, 0, 0), B = (h/2, 0, 0),
C = (0, R, 0) and D = (0, 0, R): the d(0) printed before Eq. 79. The vectors from A to C and D in Eq. 62-64
belong to other points; see the errata.
"""

from abc import abstractmethod

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import lax

from esail_jax.array_types import Array, Float, HubPoints, Rotation, Scalar, Vector
from esail_jax.numerics.small_matrices import matmul

EDGE_PAIRS = ((0, 0), (1, 1), (2, 2), (1, 0), (2, 0), (2, 1))
"""Pairs of edges (AB, AC, AD) whose scalar products are constrained, in the order of [PGV] Eq. 45."""

PICK_PAIRS = np.stack([np.eye(9)[3 * k + m] for k, m in EDGE_PAIRS])
"""Masks that select those pairs from a flattened 3 x 3 matrix of products."""

OF_HEIGHT = np.array([[-0.5, 0, 0], [0.5, 0, 0], [0, 0, 0], [0, 0, 0]])
OF_RADIUS = np.array([[0, 0, 0], [0, 0, 0], [0, 1, 0], [0, 0, 1]], float)
"""Base points A, B, C, D of unit height and of unit radius. Base points are these matrices times a number:
put together from 12 numbers they would be a tenth of all operations that a run's compiler sees."""

PER_HEIGHT = np.array([[-1, 0, 0, 0], [1, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]], float)
PER_RADIUS = np.array([[0, -0.5, -0.5, 0], [0, -0.5, -0.5, 0], [0, 1, 0, 0], [0, 0, 1, 0]])
HALVES = np.array([[0, 0, 0, 0.5], [0, 0, 0, 0.5], [0, 0, 0, 0], [0, 0, 0, 0]])
"""Terms of the matrix that maps a point (x, y, z, 1) to its weights on A, B, C, D: those divided by the
height, those divided by the radius, and the constant ones."""


class Body(eqx.Module):
    """A rigid body in natural coordinates.

    height: h_r [m] and radius: R_r [m] place the base points.
    """

    height: eqx.AbstractVar[Scalar]
    radius: eqx.AbstractVar[Scalar]

    @property
    @abstractmethod
    def second_moments(self) -> Float[Array, "4 4"]:
        """The integral of rho (x, y, z, 1) (x, y, z, 1)^T dV in the body frame [kg m^2, kg m, kg]."""

    @property
    def inertia(self) -> Float[Array, "3 3"]:
        """Inertia tensor about the hub centre in the body frame [kg m^2]: tr(S) I - S of the second moments
        S."""
        second = self.second_moments[:3, :3]
        return jnp.trace(second) * jnp.eye(3) - second

    @property
    def base_points(self) -> Float[Array, "4 3"]:
        """Base points A, B, C, D in the body frame [m]."""
        return OF_HEIGHT * self.height + OF_RADIUS * self.radius

    def weights(self, x: Float[Array, "3 *point"]) -> Float[Array, "4 *point"]:
        """Weights g of body-fixed points x: r(x) = sum_k g_k r_k, with sum g = 1 ([PGV] Eq. 131-132)."""
        return self.direction_weights(x) + self._affine_inverse()[:, 3].reshape(4, *[1] * (x.ndim - 1))

    def direction_weights(self, x: Float[Array, "3 *point"]) -> Float[Array, "4 *point"]:
        """Weights g of body-fixed directions x: sum_k g_k r_k = C_B^I x, with sum g = 0."""
        return jnp.tensordot(self._affine_inverse()[:, :3], x, 1)

    def _affine_inverse(self) -> Float[Array, "4 4"]:
        """Inverse of the map from g to (sum g_k x_k, sum g_k): alpha, beta and gamma of [PGV] Eq. 133, in
        closed form for these base points."""
        return PER_HEIGHT / self.height + PER_RADIUS / self.radius + HALVES

    @property
    def mass_matrix(self) -> Float[Array, "4 4"]:
        """Mass matrix [kg]: the integral of rho g g^T dV. The 12 x 12 matrix is its Kronecker product with
        I_3 ([PGV] Eq. 52)."""
        inverse = self._affine_inverse()
        return inverse @ self.second_moments @ inverse.T

    def edges(self, points: HubPoints) -> Float[Array, "3 3"]:
        """Edges r_AB, r_AC, r_AD as rows [m] ([PGV] Eq. 42)."""
        return points[1:] - points[0]

    def constraints(self, points: HubPoints) -> Float[Array, "6"]:
        """Rigidity constraints Phi [m]: (r_K . r_L - its reference value) over a length, for the pairs of
        Eq. 45.

        Squared lengths are divided by 2 L and products by sqrt(L_K L_L). Each constraint is then a
        deformation of the body in metres, and its multiplier a force.
        """
        reference = self.edges(self.base_points)
        products = reference @ reference.T
        lengths = jnp.sqrt(jnp.diag(products))
        scale = jnp.sqrt(lengths[:, None] * lengths) * (1.0 + np.eye(3))
        now = self.edges(points)
        return (PICK_PAIRS * ((matmul(now, now.T) - products) / scale).reshape(9)).sum(1)

    def rotation(self, points: HubPoints) -> Rotation:
        """Attitude C_B^I with the columns i_B, j_B, k_B ([PGV] Eq. 41)."""
        return matmul(points.T, self._affine_inverse()[:, :3])

    def centre(self, points: HubPoints) -> Vector:
        """Position of the hub centre O_B [m] ([PGV] Eq. 43)."""
        return 0.5 * (points[0] + points[1])

    def angular_velocity(self, points: HubPoints, velocities: HubPoints) -> Vector:
        """Angular velocity omega^B [rad/s] in body components: the axial vector of C_I^B d(C_B^I)/dt.

        Derived in place of [PGV] Eq. 62-64, whose local coordinates do not fit its base points.
        """
        rotation, rate = self.rotation(points), self.rotation(velocities)
        skew = rotation.T @ rate
        return 0.5 * jnp.stack([skew[2, 1] - skew[1, 2], skew[0, 2] - skew[2, 0], skew[1, 0] - skew[0, 1]])


class RigidBody(Body):
    """Homogeneous solid cylinder about X_B ([PGV] Table 1).

    height: h_r [m]. radius: R_r [m]. density: [kg/m^3].
    """

    height: Scalar
    radius: Scalar
    density: Scalar

    @property
    def mass(self) -> Scalar:
        """Mass m [kg]."""
        return self.density * jnp.pi * self.radius**2 * self.height

    @property
    def second_moments(self) -> Float[Array, "4 4"]:
        axial, radial = self.height**2 / 12.0, self.radius**2 / 4.0
        return self.mass * jnp.diag(jnp.stack([axial, radial, radial, jnp.ones_like(axial)]))


class Spacecraft(Body):
    """A rigid body of any shape, by its mass, its inertia tensor and its centre of mass.

    height, radius: lengths [m] that place the base points; the motion does not depend on them. mass: m
    [kg]. central_inertia: J [kg m^2] about the centre of mass, in the body frame. offset: c [m] of the
    centre of mass from the hub centre. The second moments about the hub centre are tr(J)/2 I - J + m c c^T.
    """

    height: Scalar
    radius: Scalar
    mass: Scalar
    central_inertia: Float[Array, "3 3"]
    offset: Vector

    @classmethod
    def of(cls, mass: Scalar, inertia: Float[Array, "3 3"], offset: Vector) -> "Spacecraft":
        """The body, with base points as far apart as its mass is: at the radius of gyration. Of a tensor
        the symmetric part counts, so that its two entries beside the diagonal have the same derivative."""
        inertia = 0.5 * (inertia + inertia.T)
        size = lax.stop_gradient(jnp.sqrt(0.5 * jnp.trace(inertia) / mass))
        return cls(size, size, mass, inertia, offset)

    @property
    def second_moments(self) -> Float[Array, "4 4"]:
        inertia, c, m = self.central_inertia, self.offset, self.mass
        second = 0.5 * jnp.trace(inertia) * jnp.eye(3) - inertia + m * jnp.outer(c, c)
        return jnp.block([[second, m * c[:, None]], [m * c[None], m[None, None]]])
