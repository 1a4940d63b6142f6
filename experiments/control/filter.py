"""An extended Kalman filter of a flexible sail, with the tangents of the package: gyroscopes and a star
tracker on the hub, and a camera that sees the directions of the remote units. The steering law acts on the
estimate.

The state has a position and a velocity for each of the 18 degrees of freedom of a sail of four trusses: six
of the hub and three of every tip. Around an estimate they are coordinates of the tangent space of the
constraints; `simulate(..., start=...)` projects a point back on the constraints.

    python experiments/control/filter.py

writes filter.csv and filter.png.
"""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from laws import Steering
from matplotlib.figure import Figure
from sail import CONSTANT, sail
from scipy.stats import chi2
from tables import write

import esail_jax as esail
from esail_jax.coordinates import Coordinates
from esail_jax.scenes.build import build
from esail_jax.scenes.structure import split
from esail_jax.sensors import with_motion
from esail_jax.steppers.consistent import project

HERE = Path(__file__).parent
PERIOD, SAMPLES, MEMBERS = 60.0, 40, 20
GYRO, TRACKER, CAMERA = 1e-5, 1e-4, 1e-4
"""Standard deviations: gyroscopes [rad/s], star tracker and directions of the remote units [rad]."""

HUB, ACROSS, ALONG = (1e-3, 1e-5), (5.0, 0.02), (0.01, 0.01)
"""Standard deviations of the start, of positions and velocities: coordinates of the hub [rad or m, 1/s],
and the tips across and along their tethers [m, m/s]."""

DRIFT = (1e-6, 1e-8), (1e-3, 1e-3), (1e-4, 1e-4)
"""The same for the disturbance in a period: forces that the filter does not know, such as gusts."""

PLACE = {"initial.heliocentric_position_au": [0.5**0.5, 0.5**0.5, 0.0]}
SCENE = esail.load_scene("baseline", sail(PERIOD, 14.0, PERIOD, PLACE) | CONSTANT)
STRUCTURE, NUMBERS = split(SCENE.replace({"integrator.method": "collocation"}))
SYSTEM = jax.jit(build, static_argnums=0)(STRUCTURE, NUMBERS).system
LAW = Steering(*jnp.array([5.0, 0.0, 0.3]))


def flow(point, volts):
    """The point one control period later, under constant voltages. The sail has no clock: every period
    begins at t = 0."""
    start = point._replace(time=np.zeros(()))
    given = {"times": [0.0, PERIOD], "start": start, "save": ["coning_angle"]}
    return esail.simulate(SCENE, {"voltage.value": volts}, **given).final_state


def tangent_basis(point):
    """Orthonormal basis of the hub's displacements that keep its six constraints, (12, 6)."""
    rows = jax.jacfwd(lambda hub: SYSTEM.hub.constraints(hub))(point.q.hub).reshape(6, 12)
    return jnp.linalg.svd(rows, full_matrices=True)[2][6:].T


def moved(point, basis, delta):
    """The point displaced by 18 position and 18 velocity coordinates. Velocities of the hub go with its new
    attitude to first order; `simulate` projects both."""

    def part(x, d):
        hub = x.hub + (basis @ d[:6]).reshape(4, 3)
        tips = x.tether.at[0, :, -1].add(d[6:].reshape(3, 4))
        return Coordinates(tips, hub, None)

    q, v = part(point.q, delta[:18]), part(point.v, delta[18:])
    return on_constraints(point._replace(q=q, v=v, exact=jnp.asarray(False)))


def on_constraints(point):
    """The point with hub, roots and their velocities on the constraints."""
    q, v = project(SYSTEM, jnp.zeros(()), point.q, point.v)
    return point._replace(q=q, v=v)


def coordinates(point, of, basis):
    """The 36 coordinates of a point about another one, `of`."""

    def part(x, y):
        hub = basis.T @ (x.hub - y.hub).ravel()
        return jnp.concatenate([hub, (x.tether - y.tether)[0, :, -1].ravel()])

    return jnp.concatenate([part(point.q, of.q), part(point.v, of.v)])


def measured(point):
    """Angular velocity, attitude (the columns of the rotation matrix) and directions of the tips in B, each
    in units of its standard deviation."""
    found = with_motion(
        SYSTEM, point.time, point.q, point.v, SYSTEM.directions(point.time, point.q, point.v)
    )
    seen = found.tip_position / jnp.linalg.norm(found.tip_position, axis=0)
    parts = found.angular_velocity / GYRO, found.rotation.ravel() / TRACKER, seen.ravel() / CAMERA
    return jnp.concatenate(parts)


@esail.jit
def predict(point, volts):
    """The point after a period, and the derivative of its coordinates by those before."""
    basis = tangent_basis(point)
    after = flow(point, volts)
    new = tangent_basis(after)

    def local(delta):
        return coordinates(flow(moved(point, basis, delta), volts), after, new)

    columns = jax.lax.map(lambda e: jax.jvp(local, (jnp.zeros(36),), (e,))[1], jnp.eye(36))
    return after, columns.T


@esail.jit
def update(point, covariance, reading):
    """The estimate after a reading, and its covariance (Joseph's form). Each of the 24 numbers of a reading
    has noise of its own; rotation matrix and unit vectors are not normalised."""
    basis = tangent_basis(point)
    slope = jax.jacfwd(lambda d: measured(moved(point, basis, d)))(jnp.zeros(36))
    innovation = slope @ covariance @ slope.T + jnp.eye(len(slope))
    gain = jnp.linalg.solve(innovation, slope @ covariance).T
    after = moved(point, basis, gain @ (reading - measured(point)))
    rest = jnp.eye(36) - gain @ slope
    covariance = rest @ covariance @ rest.T + gain @ gain.T
    return after, 0.5 * (covariance + covariance.T)


@esail.jit
def command(point):
    """The voltages of the steering law at a point."""
    found = with_motion(
        SYSTEM, point.time, point.q, point.v, SYSTEM.directions(point.time, point.q, point.v)
    )
    found = found._replace(wind=jnp.array([0.5**0.5, 0.5**0.5, 0.0]))
    return LAW.update(found, jnp.zeros(3))[0]


@esail.jit
def error_of(estimate, truth):
    return coordinates(truth, estimate, tangent_basis(estimate))


advance, look = esail.jit(flow), esail.jit(measured)
displaced = esail.jit(lambda point, delta: moved(point, tangent_basis(point), delta))


def covariance_of(point, hub, across, along):
    """The covariance of independent errors of the hub, and of the tips across and along their tethers."""
    chords = np.asarray(point.q.tether[0, :, -1] - point.q.tether[0, :, 0])
    chords = chords / np.linalg.norm(chords, axis=0)
    blocks = np.zeros((36, 36))
    for first, which in ((0, 0), (18, 1)):
        blocks[first : first + 6, first : first + 6] = hub[which] ** 2 * np.eye(6)
        for tip, e in enumerate(chords.T):
            at = first + 6 + tip + 4 * np.arange(3)
            outer = np.outer(e, e)
            blocks[np.ix_(at, at)] = across[which] ** 2 * (np.eye(3) - outer) + along[which] ** 2 * outer
    return blocks


def drawn(rng, covariance):
    """A normal random vector with a covariance."""
    return jnp.asarray(np.linalg.cholesky(covariance) @ rng.standard_normal(len(covariance)))


def member(seed, begin):
    """One closed loop: errors of tips and attitude, and the normalised squared error, at every sample."""
    rng = np.random.default_rng(seed)
    covariance = covariance_of(begin, HUB, ACROSS, ALONG)
    truth = displaced(begin, drawn(rng, covariance))
    estimate, rows = begin, []
    for _ in range(SAMPLES):
        reading = look(truth) + rng.standard_normal(24)
        estimate, covariance = update(estimate, covariance, reading)
        error = np.asarray(error_of(estimate, truth))
        scale = np.sqrt(np.diag(covariance))
        scaled = np.asarray(covariance) / np.outer(scale, scale)
        nees = float(error / scale @ np.linalg.solve(scaled, error / scale))
        tips = float(np.sqrt((error[6:18] ** 2).mean()))
        speeds = float(np.sqrt((error[24:36] ** 2).mean()))
        rows.append((nees, tips, speeds))
        volts = command(estimate)
        estimate, slope = predict(estimate, volts)
        disturbance = covariance_of(estimate, *DRIFT)
        covariance = slope @ covariance @ slope.T + disturbance
        covariance = 0.5 * (covariance + covariance.T)
        truth = advance(truth, volts)
        truth = displaced(truth, drawn(rng, disturbance))
    return rows


def main():
    begin = esail.simulate(SCENE, times=[0.0], save=[]).final_state
    found = np.array([member(seed, begin) for seed in range(MEMBERS)])
    mean = found[:, :, 0].mean(0)
    low, high = chi2.ppf([0.025, 0.975], 36 * MEMBERS) / MEMBERS
    inside = float(((mean >= low) & (mean <= high)).mean())
    bounds = f"inside [{low:.1f}, {high:.1f}]: {inside:.0%}"
    print(f"NEES over {MEMBERS} members: {mean.mean():.2f} of 36; {bounds}")
    tips, speeds = np.sqrt((found[:, :, 1:] ** 2).mean(0)).T
    print(
        f"rms error of the tips {tips[0]:.2f} -> {tips[-1]:.3f} m, {speeds[0]:.4f} -> {speeds[-1]:.5f} m/s"
    )
    header = ("sample", "mean NEES", "rms tip error [m]", "rms tip speed error [m/s]")
    write(
        "filter.csv", header, [(i, *map(float, x)) for i, x in enumerate(np.stack([mean, tips, speeds], 1))]
    )
    figure = Figure(figsize=(7.0, 3.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    left.axhspan(low, high, color="0.9", label="95 % bounds")
    left.plot(mean, label="mean NEES")
    left.set(xlabel="samples", ylabel="normalised squared error")
    left.legend(fontsize=8)
    right.semilogy(tips, label="tips [m]")
    right.semilogy(speeds, label="their speeds [m/s]")
    right.set(xlabel="samples", ylabel="rms error of the estimate")
    right.legend(fontsize=8)
    figure.savefig(HERE / "filter.png", dpi=150)


if __name__ == "__main__":
    main()
