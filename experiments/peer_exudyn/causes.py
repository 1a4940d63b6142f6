"""Finds the causes of the differences: simulates the baseline for 600 s with one change at a time.

python experiments/peer_exudyn/causes.py
"""

import dataclasses
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
import sail
from inputs import sail_of
from run import INTERVAL, scene_of
from signals import signals

import esail_jax as esail
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha

T_END = 600.0
SPECTRAL_RADIUS = 0.25
"""The default of the package, and the setting of Exudyn in `sail.py`."""

LOOKED_AT = ("tip_position_I", "kinetic_energy", "root_coning_angle", "angular_velocity_B", "reaction_B")


class PlainStart(GeneralizedAlpha):
    """Generalized-alpha that starts as in Exudyn, with a_0 = vdot_0: without the jerk in the first a."""

    trials: ClassVar[int] = 0


def run_ours(scene: esail.Scene, plain: bool) -> dict[str, np.ndarray]:
    """The signals of esail_jax; plain: with a_0 = vdot_0."""
    kind = PlainStart if plain else GeneralizedAlpha
    stepper = kind(jnp.asarray(scene.integrator.step), jnp.asarray(SPECTRAL_RADIUS))
    ours = esail.simulate(scene, stepper=stepper)
    return {name: np.asarray(ours[name]) for name in ours.observables}


def run_theirs(scene: esail.Scene, step: float, **options) -> dict[str, np.ndarray]:
    """The signals of Exudyn."""
    given, every = sail_of(scene), round(INTERVAL / step)
    return signals(given, sail.simulate(given, step, round(T_END / step), every, **options))


def line(label: str, ours: dict, theirs: dict) -> None:
    """Prints the largest differences, in the units of the signals."""
    gaps = [abs(ours[name] - theirs[name]).max() for name in LOOKED_AT]
    print(f"{label:58s}" + "".join(f"{gap:19.1e}" for gap in gaps), flush=True)


def with_wind(step: float) -> None:
    """Prints the effects of the start, the hub's coordinates and the tolerance."""
    scene = scene_of(step, 5, T_END)
    usual, theirs = run_ours(scene, plain=False), run_theirs(scene, step)
    plain = run_ours(scene, plain=True)
    line(f"{step} s, as compared", usual, theirs)
    line(f"{step} s, esail_jax with a_0 = vdot_0", plain, theirs)
    line(f"{step} s, esail_jax: one start or the other", usual, plain)
    turning = run_theirs(scene, step, lie_group=True)
    line(f"{step} s, Exudyn's hub on the Lie group, same start", plain, turning)
    line(f"{step} s, Exudyn's hub: Lie group or Euler parameters", turning, theirs)
    for tolerance in (1e-8, 1e-10):
        other = run_theirs(scene, step, tolerance=tolerance)
        line(f"{step} s, Exudyn with tolerance {tolerance:g} instead of 1e-9", other, theirs)


def without_wind(step: float) -> None:
    """Prints errors without wind, where the exact motion is a rigid rotation of constant energy."""
    scene = scene_of(step, 5, T_END)
    scene = dataclasses.replace(scene, voltage=None, solar_wind=None)
    time = np.arange(0.0, T_END + 1.0, INTERVAL)
    codes = {
        "esail_jax": run_ours(scene, plain=False),
        "esail_jax with a_0 = vdot_0": run_ours(scene, plain=True),
        "Exudyn": run_theirs(scene, step),
    }
    for name, run in codes.items():
        tip, energy = run["tip_position_I"][:, 0], run["kinetic_energy"]
        axes = tip[0], run["tip_position_I"][0, 3]  # tethers 1 and 4 are a quarter turn apart
        turned = np.unwrap(np.arctan2(tip @ axes[1], tip @ axes[0]))
        late = np.linalg.norm(tip[0]) * (turned - 4e-3 * time)
        print(
            f"{step} s, no wind, {name:28s} tip ahead of the exact motion by {late[-1]:9.2e} m after "
            f"{T_END:g} s; energy changed by {energy[1] - energy[0]:9.2e} J after 5 s, "
            f"{energy[-1] - energy[0]:9.2e} J at the end",
            flush=True,
        )


def root_gaps(step: float, t_end: float) -> None:
    """Prints the final gap between the root nodes and the points of the hub that hold them."""
    scene = scene_of(step, 5, t_end)
    given = sail_of(scene)
    final = esail.simulate(scene).final_state.q
    points, nodes = np.asarray(final.hub), np.asarray(final.tether)[0, :, 0].T
    centre = points[:2].mean(0)
    outward = (points[2:] - centre).T  # Y_B and Z_B times the radius
    ours = nodes - centre - given.anchors[:, 1:] / np.linalg.norm(outward, axis=0) @ outward.T
    steps = round(t_end / step)
    history = sail.simulate(given, step, steps, steps)
    held = history.hub_position[-1] + given.anchors @ history.hub_rotation[-1].T
    theirs = history.position[-1, :, 0, 0] - held
    print(
        f"{step} s, after {t_end:g} s, largest gap between root and hub: "
        f"esail_jax {abs(ours).max():.1e} m, Exudyn {abs(theirs).max():.1e} m",
        flush=True,
    )


if __name__ == "__main__":
    print(f"{'':58s}" + "".join(f"{name:>19s}" for name in LOOKED_AT))
    for step in (0.1, 0.05, 0.025):
        with_wind(step)
    for step in (0.2, 0.1):
        without_wind(step)
    for t_end in (600.0, 1200.0, 2400.0):
        root_gaps(0.05, t_end)
