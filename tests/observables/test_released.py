"""What the meanings say of a released tether is what the observables do."""

import jax.numpy as jnp
import numpy as np

from esail_jax.observables import make_instant, observe, sail
from esail_jax.observables.meanings import COUNTED, LEFT_OUT, MEANINGS, RELEASED
from esail_jax.scenes.build import build
from esail_jax.scenes.loading import load_scene
from esail_jax.scenes.structure import split
from esail_jax.system import Power
from support.quick import jit

OVERRIDES = {
    "tethers.count": 4,
    "tethers.elements": 2,
    "tethers.wire_radius": 12.5e-6,
    "event.time": [10.0],
    "event.release": [2],
}
"""Four tethers, of which the second is released: three others define the plane of the tips."""

INTEGRALS = {"dissipated_energy": "dissipated_power", "external_work": "external_power"}
"""Integrals over the run, which no state shows, and the powers that they are integrals of."""


def test_meanings_tell_in_which_observables_a_released_tether_counts():
    """Observables of the whole sail change with the motion and the voltage of a released tether exactly if
    the meanings say that it counts.

    The others have the same bits but for the reactions: that of the free end is the rounding of a balance
    of forces, 1e-13 N, with an arm of 2 km. Its thrust and its current are not zero.
    """
    structure, numbers = split(load_scene("baseline", OVERRIDES))

    @jit
    def seen(voltage, move, rate):
        time, zero = jnp.full((), 20.0), jnp.zeros(())
        model = build(structure, numbers | {"voltage.value": voltage})
        system = model.system.with_events_until(time)
        q = model.q._replace(tether=model.q.tether.at[0, :, :, 1].add(move))
        v = model.v._replace(tether=model.v.tether.at[0, :, :, 1].add(rate))
        instant = make_instant(system, jnp.array([1e11, 1e11, 0.0]), time, q, v, Power(zero, zero), zero)
        return observe(instant, tuple(entry.name for entry in sail.ON_REQUEST))

    rng = np.random.default_rng(0)
    move, rate = 2e3 * rng.normal(size=(3, 3)), rng.normal(size=(3, 3))
    volts = np.array([20e3, 20e3, 20e3, 20e3])
    before = seen(jnp.asarray(volts), jnp.zeros((3, 3)), jnp.zeros((3, 3)))
    volts[1] = 15e3
    after = seen(jnp.asarray(volts), jnp.asarray(move), jnp.asarray(rate))
    entries = {entry.name: entry for entry in (*sail.OBSERVABLES, *sail.ON_REQUEST)}
    whole = {name for name in before if not {"tether", "node"} & set(entries[name].axes)} - INTEGRALS.keys()
    changed = {
        name
        for name in whole
        if np.abs(after[name] - before[name]).max() > 1e-9 * max(np.abs(before[name]).max(), 1.0)
    }
    assert changed | INTEGRALS.keys() == set(COUNTED)
    assert all((name in COUNTED) == (power in changed) for name, power in INTEGRALS.items())
    assert not changed & set(LEFT_OUT) and set(LEFT_OUT) <= whole
    assert np.abs(before["reaction_B"][1]).max() < 1e-12 < np.abs(before["reaction_B"][0]).max()
    for name in ("thrust_B", "thrust_moment_B", "electron_current", "voltage"):
        assert np.abs(after[name][1]).max() > 0.0, name
    assert set(RELEASED) <= set(MEANINGS)
    assert MEANINGS["thrust_O"].endswith("A released tether still counts.")
