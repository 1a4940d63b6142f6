"""What is drawn of a run: positions, exaggeration, first view, colours."""

import numpy as np
import pytest

from esail_jax.files.opening import RunFileError
from esail_jax.files.reading import read_runs
from esail_jax.viewing.camera import Camera
from esail_jax.viewing.colour_scale import NONE, STOPS, channels, colours_of, locked_range
from esail_jax.viewing.drawing import Drawing, Style
from esail_jax.viewing.motion import chosen_exaggeration, exaggerated, lateral
from esail_jax.viewing.motions import read_motions
from esail_jax.viewing.sail_motion import POINTS, parabolas
from support.motion_files import (
    LENGTH,
    TETHERS,
    TIME,
    chain_rows,
    released_run,
    sail_rows,
    sail_scene,
    write_run,
)

ROUNDING = 1e-9 * LENGTH
"""Error [m] of sums and rotations of positions of kilometres."""


def motion_of(path, members=(), most=1000):
    (motion,) = read_motions([path], members, most)
    return motion


def tethers_of(motion):
    """The vertices by tether, (frame, tether, point, 3)."""
    return motion.vertices.reshape(len(motion.time), len(motion.lines), -1, 3)


def test_a_sail_turned_back_is_that_of_the_run(sail):
    """The vertices have the hub's axes. Turned and moved back they end at the tips of the run file; they
    begin at the roots, one metre from the axis."""
    motion, rows = motion_of(sail), sail_rows()
    tips = np.einsum("tib,tnb->tni", motion.rotation, tethers_of(motion)[:, :, -1])
    tips += rows["hub_position_I"][:, None]
    assert np.abs(tips - rows["tip_position_I"]).max() < ROUNDING
    roots = tethers_of(motion)[:, :, 0]
    assert np.abs(np.linalg.norm(roots, axis=-1) - 1.0).max() < ROUNDING
    assert np.abs(roots[..., 0]).max() < ROUNDING
    assert np.array_equal(motion.time, TIME)


def test_tethers_leave_their_roots_in_the_direction_of_the_run(sail):
    """Root coning is the elevation towards X_B of the first tangent, root lagging its angle in the spin
    plane. The tangent of a parabola at its beginning follows exactly from three equidistant points."""
    points, rows = tethers_of(motion_of(sail)), sail_rows()
    tangent = -3.0 * points[:, :, 0] + 4.0 * points[:, :, 1] - points[:, :, 2]
    azimuth = 2.0 * np.pi * np.arange(TETHERS) / TETHERS
    outward = tangent[..., 1] * np.cos(azimuth) + tangent[..., 2] * np.sin(azimuth)
    sideways = tangent[..., 2] * np.cos(azimuth) - tangent[..., 1] * np.sin(azimuth)
    coning = np.arctan2(tangent[..., 0], np.hypot(outward, sideways))
    assert np.abs(coning - rows["root_coning_angle"]).max() < 1e-9
    assert np.abs(np.arctan2(sideways, outward) - rows["root_lagging_angle"]).max() < 1e-9


def test_a_parabola_in_the_direction_of_its_chord_is_straight():
    roots, tips = np.array([[0.0, 1.0, 0.0]]), np.array([[[3.0, 5.0, 0.0]]])
    points = parabolas(roots, tips, np.array([[[0.6, 0.8, 0.0]]]))[0, 0]
    assert np.allclose(points, np.linspace(roots[0], tips[0, 0], POINTS), rtol=0, atol=1e-12)


def test_without_angles_at_the_roots_tethers_are_straight_and_it_is_said(folder):
    rows = {name: x for name, x in sail_rows().items() if not name.startswith("root_")}
    motion = motion_of(write_run(folder / "straight.h5", sail_scene(), TIME, rows))
    assert "straight" in motion.shape and tethers_of(motion).shape[2] == 2


def test_a_released_tether_is_a_tip_only(folder):
    """The run file does not say where the root of a released tether is."""
    scene = sail_scene(event__time=[700.0], event__release=[2])
    points = tethers_of(motion_of(write_run(folder / "released.h5", scene, TIME, sail_rows())))
    late = TIME >= 700.0
    assert np.isnan(points[late, 1, :-1]).all() and np.isfinite(points[late, 1, -1]).all()
    assert np.isfinite(points[~late]).all() and np.isfinite(points[:, [0, 2]]).all()


def test_the_picture_follows_the_tethers_that_are_held(folder, sail):
    """Frame, exaggeration and range of the colours are those of the run without a release; the released
    tether has no colour, and the picture says so. From the instant of the release on it counts as free."""
    motion, whole = motion_of(released_run(folder)), motion_of(sail)
    assert (motion.radius, motion.exaggeration) == (whole.radius, whole.exaggeration)
    assert motion.released == (None, list(TIME).index(800.0), None)
    for name, quantity in motion.colours.items():
        held = whole.colours[name].values.copy()
        held[TIME >= 800.0, 1] = np.nan
        assert np.array_equal(quantity.values, held, equal_nan=True), name
    low, high = locked_range(motion.colours["tension"].values)
    assert low > 0.05 and high < 0.35
    assert motion.remarks[-1] == "tether 2: grey when released, may leave the picture"
    assert not any("released" in remark for remark in whole.remarks)


def test_rows_after_a_failure_are_left_out(folder):
    rows = {name: np.where(TIME.reshape(-1, *[1] * (x.ndim - 1)) > 900.0, np.nan, x)
            for name, x in sail_rows().items()}  # fmt: skip
    motion = motion_of(write_run(folder / "failed.h5", sail_scene(), TIME, rows))
    assert motion.time[-1] <= 900.0 < TIME[len(motion.time)] and np.isfinite(motion.vertices).all()


def test_exaggeration_keeps_the_distance_along_a_line():
    """Lateral parts are multiplied, parts along the line stay."""
    straight = np.array([[0.0, 0.6, 0.8]])
    point = np.array([[0.3, 2.0, 5.0]])
    along, across = lateral(point, straight)
    grown = exaggerated(point, straight, 7.0)
    assert np.allclose(lateral(grown, straight)[0], along, rtol=0, atol=1e-12)
    assert np.allclose(lateral(grown, straight)[1], 7.0 * across, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("share", "factor"), [(0.29, 1.0), (0.14, 2.0), (0.012, 20.0), (1e-9, 1000.0)])
def test_chosen_exaggeration_fills_three_tenths_of_the_length(share, factor):
    """It is the largest of 1, 2, 5, 10, ... with which the lateral part stays below 0.3 of the length."""
    straight = np.array([[1.0, 0.0, 0.0]])
    assert chosen_exaggeration(np.array([[[1.0, share, 0.0]]]), straight) == factor


def test_the_first_view_of_a_sail_is_along_its_axis(sail):
    """The basis is a right-handed one: right, up, towards the viewer along X_B."""
    motion = motion_of(sail)
    assert np.allclose(motion.basis @ motion.basis.T, np.eye(3), rtol=0, atol=1e-12)
    assert np.allclose(motion.basis[2], motion.rotation[0][:, 0], rtol=0, atol=1e-12)
    assert np.linalg.det(motion.basis) > 0.0 and motion.basis[1, 2] > 0.0


def test_a_chain_hangs_downwards(chain):
    """The gravity of the scene points down in the picture, and the swing is seen from the front."""
    motion = motion_of(chain)
    shown = motion.vertices[:, -1] @ motion.basis.T
    assert (shown[:, 1] < 0.0).all()
    assert np.ptp(shown[:, 0]) > 10.0 * np.ptp(shown[:, 2])
    assert np.array_equal(motion.vertices, chain_rows()["joint_position"])
    assert not motion.turning and motion.exaggeration == 1.0


def test_colours_are_those_of_the_run(sail, chain):
    rows, colours = sail_rows(), motion_of(sail).colours
    tension = np.linalg.norm(rows["reaction_B"], axis=-1)
    assert list(colours) == ["tension", "voltage", "strain"]
    assert np.array_equal(colours["tension"].values, tension)
    assert np.array_equal(colours["voltage"].values, rows["voltage"])
    assert np.array_equal(colours["strain"].values, rows["max_axial_strain"])
    of_rods = motion_of(chain).colours
    assert np.array_equal(of_rods["tension"].values, chain_rows()["tension"])
    assert np.abs(of_rods["strain"].values).max() < 1e-12, "rods of one metre, undeformed"


def test_the_scale_of_colours_has_its_ends_and_a_colour_for_no_value():
    found = colours_of(np.array([1.0, 3.0, np.nan, 9.0]), 1.0, 3.0)
    assert found.tolist() == [list(channels(x)) for x in (STOPS[0], STOPS[-1], NONE, STOPS[-1])]
    assert locked_range(np.array([2.0, np.nan]), np.array([5.0])) == (2.0, 5.0)
    assert locked_range(20e3 * (1.0 + 1e-13 * np.arange(3))) == (20e3, 20e3), "rounding is no range"


def test_perspective_enlarges_what_is_near():
    camera = Camera(0.0, 0.0, 10.0, 400.0, 300.0)
    near, far = camera.project(np.array([[5.0, 0.0, 5.0], [5.0, 0.0, -5.0]]))
    assert near[0] > far[0] > 200.0 and near[1] == far[1] == 150.0
    assert np.isnan(camera.project(np.array([[0.0, 0.0, 60.0]]))).all(), "behind the camera"
    assert np.allclose(camera.turn() @ camera.turn().T, np.eye(3), rtol=0, atol=1e-12)


def test_instants_are_equally_spaced_and_end_with_the_last(sail):
    motion = motion_of(sail, most=11)
    assert motion.frames.tolist() == list(range(0, 41, 4)) and motion.saved == 41
    assert np.array_equal(motion.time, TIME[::4])


def test_a_member_of_an_ensemble_is_that_member(ensemble):
    motion = motion_of(ensemble, members=(1,))
    assert np.array_equal(motion.colours["voltage"].values, 2.0 * sail_rows()["voltage"])
    assert motion.title.endswith("ensemble.h5, member 1")
    assert len(read_motions([ensemble], (0, 2), 10)) == 2


def test_what_is_missing_is_named(folder, ensemble, sail):
    rows = {name: x for name, x in sail_rows().items() if name != "rotation_IB"}
    path = write_run(folder / "lacking.h5", sail_scene(), TIME, rows)
    with pytest.raises(RunFileError, match="must hold the observable rotation_IB, but lacks it"):
        motion_of(path)
    with pytest.raises(RunFileError, match="`member` must be between 0 and 2, but is 3"):
        read_runs(ensemble, (3,))
    with pytest.raises(RunFileError, match="`member` must be given with an ensemble"):
        read_runs(ensemble, ())
    with pytest.raises(RunFileError, match="`member` must be left out with a file of one run"):
        read_runs(sail, (0,))


def test_files_of_one_name_are_told_apart(folder, sail):
    """Titles are names of files, with those of their folders where these differ only."""
    other = folder / "other"
    other.mkdir()
    copy = write_run(other / "sail.h5", sail_scene(), TIME, sail_rows())
    titles = [motion.title for motion in read_motions([sail, copy], (), 10)]
    assert titles == [f"{folder.name}/sail.h5", "other/sail.h5"]


RING = {"length": 17.3e3, "area": 3e-9, "density": 1400.0, "youngs_modulus": 5e9, "elements": 1}


def test_auxiliary_tethers_join_the_tips_and_have_their_own_tension(folder):
    """Each line of the ring begins at one tip and ends at the next, the last one at the first; the
    tethers keep theirs. A quantity that a run file does not hold for the ring gives it no colour."""
    scene = sail_scene(**{f"auxiliary_tethers__{key}": value for key, value in RING.items()})
    tension = 0.01 + 0.001 * np.arange(TETHERS) + 0.0 * TIME[:, None]
    rows = sail_rows() | {"auxiliary_tension": tension}
    motion = motion_of(write_run(folder / "ring.h5", scene, TIME, rows))
    plain = motion_of(write_run(folder / "no_ring.h5", sail_scene(), TIME, sail_rows()))
    tips = plain.markers
    assert motion.markers == tips and motion.lines[:TETHERS] == plain.lines
    assert motion.lines[TETHERS:] == ((tips[0], tips[1]), (tips[1], tips[2]), (tips[2], tips[0]))
    colours = {name: quantity.values for name, quantity in motion.colours.items()}
    assert np.array_equal(colours["tension"][:, TETHERS:], tension)
    for name, values in colours.items():
        assert np.array_equal(values[:, :TETHERS], plain.colours[name].values)
    assert np.isnan(colours["voltage"][:, TETHERS:]).all()
    assert "auxiliary" in motion.model and "auxiliary" in motion.shape
    image = Drawing(motion, Style(1.0, "spinning", "tension", 320, 300)).image(0)
    without = Drawing(plain, Style(1.0, "spinning", "tension", 320, 300)).image(0)
    assert (image != without).any(axis=-1).sum() > 300  # three sides of more than a hundred pixels
