"""Files of runs with invented motions that are known in closed form, for tests of what is shown of them."""

import numpy as np

from esail_jax.files.hdf5 import atomic_hdf5
from esail_jax.files.opening import SCHEMA_VERSION
from esail_jax.observables import described
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.toml_text import to_toml

TIME = np.linspace(0.0, 1600.0, 41)
SPIN = 4e-3
TETHERS = 3
LENGTH = 10e3
SAIL = {
    "tethers.count": TETHERS,
    "tethers.elements": 2,
    "integrator.t_end": 1600.0,
    "output.interval": 40.0,
}


def sail_scene(**overrides):
    """The scene of the invented sail. overrides: by key, with `__` for the point."""
    return load_scene("baseline", SAIL | {key.replace("__", "."): x for key, x in overrides.items()})


def sail_rows(count=TETHERS, length=LENGTH):
    """The observables of a sail that spins about a fixed axis while its hub moves evenly and its
    tethers, straight, cone and lag; the directions at the roots are others."""
    phase = SPIN * TIME[:, None] + np.arange(count)
    angles = {
        "coning_angle": 0.02 + 0.01 * np.sin(phase),
        "lagging_angle": 0.015 * np.cos(phase),
        "root_coning_angle": 0.03 + 0.0 * phase,
        "root_lagging_angle": 0.01 * np.sin(phase),
    }
    c, s = np.cos(SPIN * TIME), np.sin(SPIN * TIME)
    zero, one = 0.0 * TIME, 1.0 + 0.0 * TIME
    spin = np.moveaxis(np.array([[one, zero, zero], [zero, c, -s], [zero, s, c]]), 2, 0)
    tilt = np.array([[0.6, 0.0, 0.8], [0.8, 0.0, -0.6], [0.0, 1.0, 0.0]])
    rotation = tilt @ spin
    centre = TIME[:, None] * [0.1, -0.2, 0.05]
    azimuth = 2.0 * np.pi * np.arange(count) / count
    radial = np.stack([0.0 * azimuth, np.cos(azimuth), np.sin(azimuth)], axis=1)
    sideways = np.stack([0.0 * azimuth, -np.sin(azimuth), np.cos(azimuth)], axis=1)
    coning, lagging = (angles[name][..., None] for name in ("coning_angle", "lagging_angle"))
    flat = np.cos(lagging) * radial + np.sin(lagging) * sideways
    body = radial + length * (np.sin(coning) * [1.0, 0.0, 0.0] + np.cos(coning) * flat)
    return angles | {
        "rotation_IB": rotation,
        "hub_position_I": centre,
        "tip_position_I": centre[:, None] + np.einsum("tib,tnb->tni", rotation, body),
        "reaction_B": (0.2 + 0.1 * np.sin(phase))[..., None] * [0.6, 0.0, 0.8],
        "voltage": 20e3 * (1.0 + 0.5 * np.sin(phase)),
        "max_axial_strain": 9e-4 + 1e-5 * np.cos(phase),
        "kinetic_energy": 15e3 + 0.0 * TIME,
        "thrust_O": np.stack([zero, 0.01 * s, 0.3 + 0.01 * c], axis=1),
    }


def released_run(folder, count=TETHERS):
    """Writes and returns the file of the invented sail whose second tether is released in the middle, and
    flies off."""
    rows, late = sail_rows(count), TIME > 800.0
    rows["tip_position_I"][late, 1] *= 8.0
    rows["reaction_B"][late, 1] = 1e-19
    scene = sail_scene(tethers__count=count, event__time=[800.0], event__release=[2])
    return write_run(folder / f"released_{count}.h5", scene, TIME, rows)


def chain_rows(rods=20, instants=41):
    """The observables of a chain that swings as a straight line."""
    angle = 0.8 * np.cos(np.linspace(0.0, 6.0, instants))
    line = np.stack([np.sin(angle), -np.cos(angle), 0.0 * angle], axis=1)
    return {
        "joint_position": np.arange(rods + 1)[:, None] * line[:, None],
        "tension": 10.0 + np.cos(angle)[:, None] * np.arange(rods),
        "kinetic_energy": 100.0 + angle,
    }


def write_run(path, scene, time, rows, members=None):
    """Writes a file of a run, or of an ensemble of so many members whose rows are multiples 1, 2, ... of
    these."""
    with atomic_hdf5(path, sealed=members is None) as file:
        file.attrs["schema_version"] = SCHEMA_VERSION
        file["scene"] = to_toml(scene)
        file["time"] = time
        if members is not None:
            file.attrs["members"] = members
            file["members/status"] = ["complete"] * members
        for name, values in rows.items():
            entry = described(name)
            axes = ["time", *entry.axes]
            if members is not None:
                values = np.stack([(k + 1.0) * values for k in range(members)])
                axes = ["member", *axes]
            data = file.create_dataset(f"observables/{name}", data=values)
            data.attrs.update({"unit": entry.unit, "symbol": entry.symbol})
            data.attrs["axes"] = axes
    return path
