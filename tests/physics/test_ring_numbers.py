"""Auxiliary tethers: batches, releases, resumed runs, and what is refused."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from support.quick import jit
from support.ring_sail import EACH, RING_NUMBERS, TIGHT, TRUSSES, ring_scene
from support.whole_runs import check_resumed_bits

SHORT = TRUSSES | {"integrator.t_end": 5.0, "output.interval": 5.0, "initial.coning_angle_deg": 5.0}
LISTS = (
    "tethers.length",
    "tethers.axial_damping_time",
    "auxiliary_tethers.length",
    "auxiliary_tethers.area",
    "auxiliary_tethers.axial_damping_time",
    "remote_units.mass",
    "voltage.value",
)
"""Keys whose lists have five entries in `ring_sail.SAIL`."""


# ---- batches ----------------------------------------------------------------------------------------


def ring_signals(numbers):
    """Signals at the end of a short run."""
    names = ("tip_position_I", "auxiliary_tension", "kinetic_energy", "dissipated_energy")
    run = esail.simulate(ring_scene(SHORT | TIGHT), numbers, save=names)
    return {name: run[name][-1] for name in names}


@pytest.mark.nightly
def test_batch_of_lengths_equals_a_loop():
    """Members of a batch with other segment lengths do not influence each other, also through the steady
    start: tips to 1e-8 m, other signals to 1e-9, the rounding of the dissipated energy, which is a small
    sum of powers."""
    key = "auxiliary_tethers.length"
    value, size = RING_NUMBERS[key]
    lengths = value + size * np.array([[-10.0], [10.0]]) * EACH
    batch = jit(jax.vmap(lambda x: ring_signals({key: x})))(jnp.asarray(lengths))
    for i, length in enumerate(lengths):
        for name, exact in ring_signals({key: length.tolist()}).items():
            bound = 1e-8 if name == "tip_position_I" else 1e-9 * np.abs(exact).max()
            np.testing.assert_allclose(batch[name][i], exact, rtol=0, atol=bound)
    assert np.abs(np.diff(batch["tip_position_I"], axis=0)).max() > 1e-3


# ---- events, resuming, bad input --------------------------------------------------------------------


@pytest.mark.nightly
@pytest.mark.parametrize(
    "method", ["collocation", pytest.param("generalized-alpha", marks=pytest.mark.nightly)]
)
def test_resumed_run_is_bit_identical_and_the_ring_holds_a_released_tether(method, tmp_path):
    """A run with a ring of cables and a release that is continued from its file is that of one run, bit for
    bit; and the released tether stays joined to its neighbours by the ring."""
    from esail_jax.scenes.toml_text import to_toml

    scene = ring_scene({
        "auxiliary_tethers.element": "cable",
        "integrator.method": method,
        "integrator.step": 0.1 if method == "generalized-alpha" else None,
        "output.interval": 2.0,
    })  # fmt: skip
    file = tmp_path / "scene.toml"
    file.write_text(to_toml(scene) + "\n[[event]]\ntime = 3.3\nrelease = 2\n")
    one = check_resumed_bits(file, (6, 12), tmp_path)
    tips = np.asarray(one["tip_position_I"])
    chords = np.linalg.norm(np.roll(tips, -1, axis=1) - tips, axis=-1)
    lengths = np.array(scene.auxiliary_tethers.length)
    tension = np.asarray(one["auxiliary_tension"])
    reaction = np.linalg.norm(np.asarray(one["reaction_B"]), axis=-1)
    assert reaction[0, 1] > 0.1 and (reaction[2:, 1] < 1e-9).all()
    assert (np.abs(chords / lengths - 1.0) < 0.05).all()
    assert tension[-1, 0] > 0.02 and tension[-1, 1] > 0.02
    error = np.abs(np.asarray(one["energy_balance_error"])).max()
    assert error < 1e-4 * np.asarray(one["kinetic_energy"])[0]


REFUSED = {
    "count": ("tethers.count", 2, "be 3 or more with [auxiliary_tethers], but is 2"),
    "list": ("auxiliary_tethers.length", [1.0, 2.0], "be a number or a list of 5"),
    "area": ("auxiliary_tethers.area", -1.0, "be positive, but is -1.0"),
    "slack": ("auxiliary_tethers.slack_strain", 0.0, "lie in (0, 1), but is 0.0"),
    "elements": ("auxiliary_tethers.elements", 0, "be a positive integer, but is 0"),
    "kind": ("auxiliary_tethers.element", "rod", 'be "cable" or "truss"'),
    "explicit": ("integrator.method", "dopri8", 'be "generalized-alpha" or "energy-momentum" or'),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_ring_is_refused_in_one_line(case):
    """Every wrong value of the ring is refused before anything is built, by a line that names the key."""
    key, value, must = REFUSED[case]
    others = dict.fromkeys(LISTS, 1.0) if case == "count" else {}
    with pytest.raises(esail.SceneError) as refused:
        ring_scene(others | {key: value})
    assert f"`{key}` must {must}" in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.nightly
def test_ring_without_a_steady_start_is_refused():
    """Segments whose force grows more slowly with length than the centrifugal force leave no steady
    start."""
    weak = TRUSSES | {"auxiliary_tethers.youngs_modulus": [1e3] * 5}
    with pytest.raises(esail.SceneError, match=r"`auxiliary_tethers\.length` must leave the sail a steady"):
        esail.simulate(ring_scene(weak))
