"""Warnings that a sail is lost, from saved rows, and about a hub that spins about an unstable axis."""

import numpy as np
import pytest

import esail_jax as esail
from esail_jax.observables.lost_sail import lost_warning
from esail_jax.scenes.plausibility import doubts

COUNT, TIMES = 4, 6


def rows(turn=0.0, flip=False, swap=False, near=False, lag=0.3):
    """Rows of a flat sail of 10 km that turns, and in which something happens in row 3."""
    time = np.arange(TIMES)
    azimuth = 2.0 * np.pi * np.arange(COUNT) / COUNT + np.zeros((TIMES, 1))
    if swap:  # the second tether passes the third
        azimuth[:, 1] += np.clip(time - 2, 0, 2) * 0.9
    body = 1e4 * np.stack([0.0 * azimuth, np.cos(azimuth), np.sin(azimuth)], axis=-1)
    angle = turn * time
    c, s, zero, one = np.cos(angle), np.sin(angle), 0.0 * angle, 1.0 + 0.0 * angle
    rotation = np.stack([np.stack([one, zero, zero], -1), np.stack([zero, c, -s], -1),
                         np.stack([zero, s, c], -1)], axis=1)  # fmt: skip
    tips = np.einsum("txb,tib->tix", rotation, body)
    if flip:
        rotation = rotation.copy()
        rotation[3:, :, :2] *= -1.0  # half a turn about Z_B: the hub has turned over
        tips = tips + 0.0
    distance = np.full(TIMES, 7e3)
    if near:
        distance[3:] = 19.0
    lagging = np.full((TIMES, COUNT), 0.1)
    lagging[3:, 2] = lag
    return {"tip_position_I": tips, "rotation_IB": rotation, "hub_position_I": np.zeros((TIMES, 3)),
            "smallest_tether_distance": distance, "lagging_angle": lagging}  # fmt: skip


SCENE = esail.load_scene("baseline", {"tethers.count": COUNT})


@pytest.mark.parametrize("turn", [0.0, 1.1, -2.9])
def test_a_sail_in_order_is_not_warned_of(turn):
    """At rest and in both senses of the spin, also by more than half a turn between rows."""
    assert lost_warning(rows(turn), SCENE) == ""


@pytest.mark.parametrize("turn", [0.0, 1.1, -2.9])
@pytest.mark.parametrize(
    ("what", "words"),
    [
        ({"lag": -1.7}, "tether 3 lags by more than 90 deg"),
        ({"flip": True}, "the hub's axis is more than 90 deg from the normal of the tips"),
        ({"swap": True}, "tips have changed their order around the hub"),
        ({"near": True}, "a tip is 19 m from another tether"),
    ],
)
def test_what_is_lost_is_named(what, words, turn):
    said = lost_warning(rows(turn, **what), SCENE)
    assert said.startswith("The sail may be lost: ") and words in said and "saved row" in said


def test_released_tethers_do_not_count():
    scene = SCENE.replace({"event.time": [1.0], "event.release": [3], "integrator.t_end": 10.0})
    assert lost_warning(rows(lag=-1.7), scene) == ""


def test_a_run_that_saved_little_is_not_judged():
    assert lost_warning({"coning_angle": np.zeros((TIMES, COUNT))}, SCENE) == ""


def test_an_unstable_axis_is_doubted():
    """A long cylinder whose tethers have no tension to speak of; a flat one and the baseline are right."""
    long = {"hub.height": 30.0, "remote_units.mass": 1e-6, "tethers.area": 1e-14}
    assert any("axis that is not stable" in x for x in doubts(SCENE.replace(long)))
    flat = SCENE.replace(long | {"hub.height": 0.5})
    assert not any("axis" in x for x in (*doubts(flat), *doubts(SCENE)))
