"""Root joints: tethers held by a hub or by a frame with prescribed rotation, and their release.

A spherical joint C = G(x_i) d - S(0) e = 0 ([PGV] Eq. 53) identifies the root with a point of the hub. A
clamped root also keeps its slope along a body-fixed direction: two conditions c_j . r_x = 0 with body-fixed
normals c_j. The stretch at the root stays free.

A tether may be released at a given time; from then on nothing holds its root. The motion is continuous at
that instant, but accelerations and reactions are not. A run therefore restarts there from its state.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from esail_jax.array_types import Array, Bool, Float, HubPoints, Maybe, PerTether, Rotation, Scalar, Vector
from esail_jax.numerics.own_derivative import custom_jvp
from esail_jax.numerics.small_matrices import matmul


def radial_directions(azimuth: PerTether) -> Float[Array, "3 tether"]:
    """Body-fixed unit vectors from the spin axis through the roots; azimuth [rad] from Y_B about X_B."""
    return jnp.stack([jnp.zeros_like(azimuth), jnp.cos(azimuth), jnp.sin(azimuth)])


def even_azimuths(count: int) -> PerTether:
    """Azimuths 2 pi i / p [rad] of evenly spaced roots."""
    return 2.0 * jnp.pi * jnp.arange(count) / count


def azimuths_of(positions: Float[Array, "3 tether"]) -> PerTether:
    """Azimuths [rad] of roots at these body-fixed positions; that of a root on the spin axis is even."""
    _, y, z = positions
    on_axis = y**2 + z**2 == 0.0
    azimuths = jnp.arctan2(z, jnp.where(on_axis, 1.0, y))
    return jnp.where(on_axis, even_azimuths(positions.shape[-1]), azimuths)


def clamp_normals(azimuth: PerTether) -> Float[Array, "2 3 tether"]:
    """Two body-fixed unit vectors normal to each root direction: X_B and the azimuthal one."""
    zero, one = jnp.zeros_like(azimuth), jnp.ones_like(azimuth)
    return jnp.stack(
        [
            jnp.stack([one, zero, zero]),
            jnp.stack([zero, -jnp.sin(azimuth), jnp.cos(azimuth)]),
        ]
    )


class Releases(eqx.Module):
    """Times at which tethers are released.

    release_time: [s] of every tether, infinite for one that is never released. released: which tethers are
    released now. Both are None if no tether ever is.
    """

    release_time: PerTether | None = None
    released: Bool[Array, " tether"] | None = None

    def with_events_until(self, time: Scalar | np.ndarray) -> "Releases":
        """The releases after all events up to `time`, that instant included."""
        if self.release_time is None:
            return self
        return Releases(self.release_time, self.release_time <= time)

    def where_released(self, own: Array, held: Array) -> Array:
        """`own` for released tethers, `held` for the others: arrays with the tether last, or numbers."""
        return held if self.released is None else jnp.where(self.released, own, held)


class HubRoots(eqx.Module):
    """Roots on the hub.

    weights: g with root_i = sum_k g_k,i r_k of the base points r_k. normals: weights of the clamp normals
    on the base points; None if the roots are pinned. azimuth: of the roots [rad]; None for even ones.
    """

    weights: Float[Array, "4 tether"]
    normals: Maybe[Float[Array, "2 4 tether"]]
    releases: Releases = Releases()
    azimuth: PerTether | None = None

    @property
    def radial_directions(self) -> Float[Array, "3 tether"]:
        """Unit vectors from the spin axis through the roots, in the body frame B."""
        if self.azimuth is not None:
            return radial_directions(self.azimuth)
        return radial_directions(even_azimuths(self.weights.shape[-1]))

    def moved_reactions(self, reactions: Float[Array, "3 tether"]) -> HubPoints:
        """`moved_reactions` of the roots that are held."""
        return moved_reactions(self.releases.where_released(jnp.zeros(()), self.weights), reactions)

    def positions(self, points: HubPoints) -> Float[Array, "3 tether"]:
        """Root positions from those of the base points. The map is linear: velocities give velocities, and
        accelerations give accelerations."""
        return matmul(points.T, self.weights)

    def clamp_directions(self, points: HubPoints) -> Float[Array, "2 3 tether"]:
        """Clamp normals c_j of every tether in the inertial frame."""
        return jnp.einsum("kx,jkt->jxt", points, self.normals)


@custom_jvp
def moved_reactions(weights: Float[Array, "4 tether"], reactions: Float[Array, "3 tether"]) -> HubPoints:
    """Zero, with the derivative dW f of the weights W of the roots on the hub's points.

    The equations of the hub contain W f with the reactions f of the roots. The solvers add it to a residual
    that does not contain it, so that the derivative of that residual lacks dW f; the derivative of the
    solution, W df, they have. Roots at a radius need no such term: their weights do not depend on it."""
    return jnp.zeros((4, 3)) + 0.0 * reactions[0, 0]


@moved_reactions.defjvp
def _moved_reactions_jvp(primals, tangents):
    (weights, reactions), (moved, _) = primals, tangents
    return moved_reactions(weights, reactions), moved @ reactions.T


class FrameRoots(eqx.Module):
    """Roots on a frame that rotates about X_B at a constant rate; its centre is fixed in space.

    start: C_B^I(0). rate: [rad/s]. anchors: root positions (3, tether) [m] in that frame. normals: clamp
    normals in that frame; None if the roots are pinned.
    """

    start: Rotation
    rate: Scalar
    anchors: Float[Array, "3 tether"]
    normals: Maybe[Float[Array, "2 3 tether"]]
    releases: Releases = Releases()

    @property
    def azimuth(self) -> None:
        """Azimuths of the roots: even ones."""
        return None

    @property
    def radial_directions(self) -> Float[Array, "3 tether"]:
        """Unit vectors along the azimuths of the roots, in the body frame B."""
        return radial_directions(even_azimuths(self.anchors.shape[-1]))

    def rotation(self, time: Scalar) -> Rotation:
        """C_B^I(t)."""
        return self.start @ rotation_about_x(self.rate * time)

    def to_inertial(
        self, time: Scalar, body: Float[Array, "*batch 3 tether"], derivative: int = 0
    ) -> Array:
        """Inertial components of body-fixed vectors, or their first or second time derivative."""
        spin = jnp.stack([self.rate, jnp.zeros_like(self.rate), jnp.zeros_like(self.rate)])
        for _ in range(derivative):
            body = jnp.cross(spin[:, None], body, axis=-2)
        return jnp.einsum("xb,...bt->...xt", self.rotation(time), body)


def rotation_about_x(angle: Scalar) -> Rotation:
    """Active rotation about the first axis."""
    c, s, zero, one = jnp.cos(angle), jnp.sin(angle), jnp.zeros_like(angle), jnp.ones_like(angle)
    return jnp.array([[one, zero, zero], [zero, c, -s], [zero, s, c]])


def rotation_about_y(angle: Scalar) -> Rotation:
    """Active rotation about the second axis."""
    c, s, zero, one = jnp.cos(angle), jnp.sin(angle), jnp.zeros_like(angle), jnp.ones_like(angle)
    return jnp.array([[c, zero, s], [zero, one, zero], [-s, zero, c]])


def spin_vector(rotation: Rotation, rate: Scalar) -> Vector:
    """Angular velocity omega [rad/s] in the inertial frame of a body that spins at `rate` about its X_B."""
    return rotation[:, 0] * rate
