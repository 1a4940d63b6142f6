"""A posterior that is bent: error bars, profiles and sampling (NUTS of blackjax) side by side.

The camera sees the product k sqrt(n) of thrust factor and density; of the density a wide prior is known.
"""

import sys

import jax
import jax.numpy as jnp
import numpy as np
from common import HERE, Timer, small, table
from matplotlib.figure import Figure

import esail_jax as esail
from esail_jax.identification.fit import Problem
from esail_jax.identification.model import predicted, steps_with_room

FREE = ["solar_wind.thrust_factor", "solar_wind.number_density"]
PRIOR = (7.3e6, 2.5e6)
NOISE = {"tip_direction_B": 1.2e-4}
CHANGES = {"tethers.elements": 1, "integrator.t_end": 20.0, "output.interval": 2.0}
SAMPLES, WARM = 800, 100


def data_of(scene):
    """Camera pictures of the scene with noise."""
    times = np.arange(2.0, 20.1, 2.0)
    exact = np.asarray(
        esail.simulate(scene, save=("tip_direction_B",), times=times.tolist())["tip_direction_B"]
    )
    noise = NOISE["tip_direction_B"] * np.random.default_rng(5).normal(size=exact.shape)
    return {"time": times, "tip_direction_B": exact + noise}


def log_density(problem):
    """The logarithm of the posterior of parameters in units of those of the scene, with derivatives by
    forward mode. The prior is flat for positive parameters, but for that of the density."""
    cells, start = problem.cells[0], np.array([p.start for p in problem.parameters])
    shown = predicted(problem.scene, problem.parameters, cells, steps_with_room(problem.scene, cells))
    mean, sd = (x / start[1] for x in PRIOR)

    def residuals(z):
        r = (shown(z * start) - cells.values) / cells.deviations
        return jnp.append(r, (z[1] - mean) / sd)

    def whole(z):
        push = lambda d: jax.jvp(residuals, (z,), (d,))  # noqa: E731
        r, jacobian = jax.vmap(push, out_axes=(None, -1))(jnp.eye(2))
        return -0.5 * r @ r, -(jacobian.T @ r)

    @jax.custom_vjp
    def log_p(z):
        inside = jnp.where((z > 0.02).all(), z, 1.0)
        return jnp.where((z > 0.02).all(), whole(inside)[0], -jnp.inf)

    def forward(z):
        inside = jnp.where((z > 0.02).all(), z, 1.0)
        value, slope = whole(inside)
        return jnp.where((z > 0.02).all(), value, -jnp.inf), slope

    log_p.defvjp(forward, lambda slope, given: (given * slope,))
    return log_p, start


def sampled(problem, found):
    """Samples of the posterior (sample, parameter), and how many were divergent."""
    import blackjax

    log_p, start = log_density(problem)
    scale = found.covariance / np.outer(start, start)
    kernel = blackjax.nuts(
        log_p, step_size=0.5, inverse_mass_matrix=jnp.asarray(scale), max_num_doublings=5
    )
    first = kernel.init(jnp.asarray(found.values / start))

    def step(state, key):
        state, info = kernel.step(key, state)
        return state, (state.position, info.is_divergent, info.num_integration_steps, info.acceptance_rate)

    keys = jax.random.split(jax.random.key(3), SAMPLES + WARM)
    _, (z, divergent, steps, accepted) = jax.jit(lambda s, k: jax.lax.scan(step, s, k))(first, keys)
    print(f"{int(steps.sum())} steps of leapfrog, acceptance {float(accepted.mean()):.2f}")
    return np.asarray(z)[WARM:] * start, int(np.asarray(divergent)[WARM:].sum())


def effective(x):
    """Effective number of samples of a series, by its autocorrelation up to where it is negative."""
    y = x - x.mean()
    r = np.correlate(y, y, "full")[len(y) - 1 :] / (y @ y)
    end = int(np.argmax(r < 0.0)) or len(r)
    return len(x) / (1.0 + 2.0 * r[1:end].sum())


def main():
    scene = small(CHANGES)
    problem = Problem.of(scene, data_of(scene), FREE, NOISE, {FREE[1]: PRIOR})
    timer = Timer()
    found = problem.solved()
    print(found)
    profiles = [found.profile(name) for name in FREE]
    print(f"fit and profiles with compiling: {timer.read()[0]:.0f} s")
    timer = Timer()
    samples, divergent = sampled(problem, found)
    print(
        f"{len(samples)} samples with compiling: {timer.read()[0]:.0f} s, {divergent} divergent",
        file=sys.stderr,
    )
    rows = []
    for k, name in enumerate(FREE):
        x = samples[:, k]
        low, middle, high = np.percentile(x, [15.87, 50.0, 84.13])
        rows.append({
            "parameter": name, "estimate": found.values[k], "sd": found.sd[k],
            "profile, low end": profiles[k][0], "profile, high end": profiles[k][1],
            "mean of samples": x.mean(), "sd of samples": x.std(ddof=1), "16 % quantile": low,
            "median": middle,
            "84 % quantile": high, "effective samples": f"{effective(x):.0f}",
        })  # fmt: skip
    table(HERE / "bent.csv", rows)
    axes = (figure := Figure((5.5, 4.2), layout="constrained")).subplots()
    axes.plot(samples[:, 1] / 1e6, samples[:, 0], ".", markersize=2.5, alpha=0.5, label="samples")
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    ellipse = found.values[:, None] + np.linalg.cholesky(found.covariance) @ np.array(
        [np.cos(angle), np.sin(angle)]
    )
    axes.plot(ellipse[1] / 1e6, ellipse[0], "k-", label="ellipse of one standard deviation")
    axes.set(xlabel="number density [1/cm^3]", ylabel="thrust factor [-]")
    axes.legend(fontsize=8)
    figure.savefig(HERE / "bent.png", dpi=80)
