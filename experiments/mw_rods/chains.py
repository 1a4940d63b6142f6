"""Chains of elastic rods and two integrators of high order, without any code of esail_jax.

n rods hang from a fixed point. Rod i is the vector x_i [m] from joint i-1 to joint i; it stays straight,
its mass m [kg] is uniform along its undeformed length l [m], and velocity is linear along it. Let u, w
[m/s] be the velocities of its two ends and EA [N] its stiffness, also in compression. Then

    T = sum m (|u|^2 + u.w + |w|^2) / 6             [J]
    U = sum EA (|x| - l)^2 / (2 l)                  [J]
    V = -sum m g.(centre of the rod)                [J]

so that the joints r_i = x_1 + ... + x_i follow M r'' = m' g - D^T f. M is tridiagonal with 2 m/3 (at the
tip m/3) on the diagonal, m/6 beside it; m' = m (at the tip m/2); D r = x; f = EA (|x| - l) / l x / |x| [N].
Both integrators work with the rods:  x'' = D M^-1 m' g - (D M^-1 D^T) f(x)  [m/s^2].

`gauss`:  collocation at 8 points, order 16, fixed step, fixed-point iteration, long double (64 bits).
`dop853`: SciPy's explicit pair of order 8, step-size control by a tolerance, double precision.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import DOP853

GRAVITY = 9.81  # [m/s^2]
DIRECTIONS = {
    f"{word}_{axis}": sign * np.eye(3)[k]
    for word, sign in (("minus", -1.0), ("plus", 1.0))
    for k, axis in enumerate("xyz")
}


@dataclass(frozen=True)
class Chain:
    """Equal rods that start as x_i = (0, -length, 0) [m], x_i' = (speed, 0, 0) [m/s]."""

    rods: int
    mass: float  # of one rod [kg]
    length: float  # of one rod [m]
    stiffness: float  # EA [N]
    duration: float  # [s]
    saved: float  # time between two saved states [s]
    speed: float  # [m/s]

    def start(self):
        """x [m] and x' [m/s] of the rods, (n, 3) each."""
        ones = np.ones((self.rods, 1))
        return ones * [0.0, -self.length, 0.0], ones * [self.speed, 0.0, 0.0]

    def times(self):
        """The times of the saved states [s]."""
        return np.linspace(0.0, self.duration, round(self.duration / self.saved) + 1)

    def matrices(self, dtype):
        """D M^-1 m' (n) and EA / l D M^-1 D^T (n, n) [1/s^2], computed in `dtype`."""
        n, m = self.rods, dtype(self.mass)
        eye, below = np.eye(n, dtype=dtype), np.eye(n, k=-1, dtype=dtype)
        mass, weight = 2 * m / 3 * eye + m / 6 * (below + below.T), np.full(n, m)
        mass[-1, -1], weight[-1] = m / 3, m / 2
        inverse = np.linalg.inv(mass.astype(float)).astype(dtype)
        for _ in range(3):  # Newton-Schulz: NumPy inverts in double precision only
            inverse = inverse @ (2 * eye - mass @ inverse)
        difference = eye - below
        spring = dtype(self.stiffness) / dtype(self.length)
        return difference @ inverse @ weight, spring * (difference @ inverse @ difference.T)

    def acceleration(self, direction, dtype):
        """The function x -> x'' [m/s^2] for arrays (..., n, 3) of `dtype`, with gravity along
        `direction`."""
        weight, response = self.matrices(dtype)
        fall, one, length = weight[:, None] * (dtype(GRAVITY) * direction), dtype(1), dtype(self.length)
        fall = fall.astype(dtype)

        def function(x):
            square = x * x
            norm = np.sqrt(square[..., 0] + square[..., 1] + square[..., 2])[..., None]
            return fall - response @ (x * (one - length / norm))

        return function

    def energy(self, x, v, direction):
        """T + U + V [J] from the definitions above, not from the matrices of the equations of
        motion."""
        mass, length, stiffness, gravity = np.array(
            [self.mass, self.length, self.stiffness, GRAVITY], x.dtype
        )
        ends, speeds = np.cumsum(x, axis=-2), np.cumsum(v, axis=-2)
        before, centres = speeds - v, ends - x / 2
        kinetic = mass * (before**2 + before * speeds + speeds**2).sum((-1, -2)) / 6
        elastic = stiffness * ((np.sqrt((x * x).sum(-1)) - length) ** 2).sum(-1) / (2 * length)
        return kinetic + elastic - mass * gravity * (centres @ direction).sum(-1)


def gauss_coefficients(points, dtype):
    """Nodes c, weights b, integrals of L_j from 0 to c_i, and L_j(1 + c_i), where L_j(c_k) =
    delta_jk."""
    z = np.cos(np.pi * (np.arange(points, 0, -1, dtype=dtype) - dtype(0.25)) / (points + dtype(0.5)))
    for _ in range(8):  # Newton's method on the Legendre polynomial
        previous, value = np.ones_like(z), z
        for k in range(2, points + 1):
            previous, value = value, ((2 * k - 1) * z * value - (k - 1) * previous) / k
        slope = points * (z * value - previous) / (z * z - 1)
        z = z - value / slope
    c, b = (1 + z) / 2, 1 / ((1 - z * z) * slope * slope)

    def lagrange(t):
        others = [[k for k in range(points) if k != j] for j in range(points)]
        return np.stack(
            [np.prod([(t - c[k]) / (c[j] - c[k]) for k in others[j]], 0) for j in range(points)], -1
        )

    return c, b, c[:, None] * np.einsum("k,ikj->ij", b, lagrange(c[:, None] * c)), lagrange(1 + c)


def gauss(chain, direction, x, v, step, points=8, dtype=np.longdouble):
    """x and v of the rods at the saved times, (times, ..., n, 3), from initial x, v (..., n, 3).

    Steps divide the interval between saved times and are at most `step` [s].
    """
    acceleration = chain.acceleration(direction, dtype)
    c, b, integral, ahead = gauss_coefficients(points, dtype)
    per_save = int(np.ceil(chain.saved / step - 1e-9))
    h = dtype(chain.duration) / ((len(chain.times()) - 1) * per_save)
    inner, last, column = h * h * (integral @ integral), h * h * (b @ integral), c[:, None] * h
    shape, rounding = np.shape(x), np.finfo(dtype).eps * dtype(chain.length)
    x, v = np.asarray(x, dtype).ravel(), np.asarray(v, dtype).ravel()
    stages = np.tile(acceleration(x.reshape(shape)).ravel(), (points, 1))
    states = [(x, v)]
    for _ in chain.times()[1:]:
        for _ in range(per_save):
            line, stages, change = x + column * v, ahead @ stages, np.inf
            for _ in range(60):
                old, places = stages, (line + inner @ stages).reshape(points, *shape)
                stages = acceleration(places).reshape(points, -1)
                before, change = change, h * h * np.abs(stages - old).max()
                if change <= rounding or (change <= 1000 * rounding and 2 * change > before):
                    break  # converged, or limited by rounding
            else:
                raise RuntimeError("the stages of a Gauss step did not converge")
            x, v = x + h * v + last @ stages, v + h * (b @ stages)
        states.append((x, v))
    return tuple(np.stack(part).reshape(-1, *shape) for part in zip(*states, strict=True))


def dop853(chain, direction, tolerance):
    """The same as `gauss`, from the chain's own start, by SciPy's DOP853.

    The tolerance is relative, and absolute in units of a rod's length. A step ends at every saved time,
    because SciPy's dense output has a lower order than the steps."""
    acceleration, shape = chain.acceleration(direction, np.float64), (chain.rods, 3)

    def rate(_, y):
        x, v = np.split(y, 2)
        return np.concatenate([v, acceleration(x.reshape(shape)).ravel()])

    states, first = [np.concatenate([part.ravel() for part in chain.start()])], None
    options = {"rtol": tolerance, "atol": tolerance * chain.length}
    for begin, end in pairwise(chain.times()):
        solver = DOP853(rate, begin, states[-1], end, first_step=first, **options)
        while solver.status == "running":
            solver.step()
            if (
                solver.t < end or first is None
            ):  # the last step is shortened and gives no guess for the next one
                first = min(solver.step_size, chain.saved / 2)
        if solver.status == "failed":
            raise RuntimeError("DOP853 failed")
        states.append(solver.y)
    return tuple(np.stack(states).reshape(len(states), 2, *shape).swapaxes(0, 1))


def tip(x):
    """The position of the free end [m]."""
    return x.sum(-2)
