"""Synthetic runs of a sail, for tests of what is computed or drawn from a run."""

import dataclasses

import numpy as np

from esail_jax.scenes.loading import load_scene

INTERVAL = 20.0
PERIOD = 2.0 * np.pi / 4e-3
TIME = np.append(np.arange(0.0, 1.5 * PERIOD, INTERVAL), 1.5 * PERIOD)
OF_HUB = ("angular_velocity_B", "euler_hub", "hub_position_I")


@dataclasses.dataclass
class FakeRun:
    """An object that replaces a solution in figures."""

    scene: object
    time: np.ndarray
    data: dict

    @property
    def observables(self):
        return set(self.data)

    def __getitem__(self, name):
        return self.data[name]


def scene_of(count=3, **tables):
    scene = load_scene("baseline")
    return dataclasses.replace(scene, tethers=dataclasses.replace(scene.tethers, count=count), **tables)


def make_run(scene):
    """A run of smooth, invented signals with the names and shapes of a sail's observables."""
    count = scene.tethers.count
    turn, rng = 2.0 * np.pi * TIME / PERIOD, np.random.default_rng(0)

    def wave(*shape, mean=0.0, size=1.0):
        phase = rng.uniform(0.0, 6.0, shape)
        return mean + size * np.sin(turn.reshape(-1, *[1] * len(shape)) + phase)

    scalars = (
        "sailing_angle thrust_angle reaction_angle kinetic_energy elastic_energy dissipated_power "
        "external_power dissipated_energy external_work energy_balance_error precession_angle "
        "smallest_tether_distance electric_power"
    )
    vectors = (
        "angular_velocity_B euler_hub euler_sail hub_position_I thrust_O thrust_moment_O "
        "reaction_O reaction_moment_O"
    )
    data = {name: wave(mean=2.0) for name in scalars.split()}
    data |= {name: wave(3) for name in vectors.split()}
    angles = "coning_angle lagging_angle root_coning_angle root_lagging_angle"
    data |= {name: wave(count, size=0.02) for name in angles.split()}
    data |= {name: wave(count, 3) for name in ("thrust_B", "thrust_moment_B", "reaction_B")}
    data["tether_length"] = wave(count, mean=10e3)
    data["max_axial_strain"] = wave(count, mean=9e-4, size=1e-5)
    data["voltage"] = wave(count, mean=20e3, size=2e3)
    data["tip_position_I"] = 10e3 * wave(count, 3)
    if scene.hub is None:
        data = {name: values for name, values in data.items() if name not in OF_HUB}
    if count < 3:
        data["euler_sail"] = np.full((len(TIME), 3), np.nan)
        data["precession_angle"] = np.full(len(TIME), np.nan)
    if count < 2:
        data["smallest_tether_distance"] = np.full(len(TIME), np.nan)
    return FakeRun(scene, TIME, data)
