"""Figures of short runs of rod chains."""

import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure

import esail_jax
from esail_jax import plotting, simulate
from esail_jax.plotting.chain import libration_angles
from support.fake_run import FakeRun
from support.figures import check_axes, panels

SHORT = {
    "hanging": ("hanging-chain", {"integrator.t_end": 0.3, "output.interval": 0.02, "chain.rods": 11}),
    "steel": ("steel-chain", {"integrator.t_end": 0.02}),
    "satellite": ("tethered-satellite", {"integrator.t_end": 1000.0}),
    "one rod": (
        "hanging-chain",
        {"integrator.t_end": 0.1, "chain.rods": 1, "chain.axial_damping_time": 1e-3},
    ),
}
"""Built-in chains and overrides. With eleven rods the first two chains share a program."""

CHAINS = (*SHORT, "failed", "start only")


def rows_of(run, change):
    """A copy with changed rows."""
    data = {name: change(np.array(run[name])) for name in run.observables}
    return FakeRun(run.scene, np.asarray(run.time)[: len(data["tension"])], data)


def lost_from(index):
    def change(values):
        values[index:] = np.nan
        return values

    return change


class Chains(dict):
    """Runs by name, each of which is made when it is first asked for."""

    def __missing__(self, name):
        if name == "failed":
            self[name] = rows_of(self["satellite"], lost_from(20))
        elif name == "start only":
            self[name] = rows_of(self["hanging"], lambda values: values[:1])
        else:
            scene, changes = SHORT[name]
            self[name] = simulate(scene, changes | {"integrator.method": "dopri5"})
        return self[name]


@pytest.fixture(scope="module")
def chains():
    return Chains()


FIGURES = [make for make in plotting.CHAIN_FIGURES if make is not plotting.chain_deployment]
"""The figures of a chain of constant length."""


def test_the_figure_of_a_deployment(chains):
    """Length, rate, tension of the first rod and work of the winch; the work is among the others, too."""
    run = rows_of(chains["one rod"], lambda values: values)
    assert not plotting.chain_deployment(run).axes
    names = ("deployed_length", "payout_rate", "winch_work", "external_work", "dissipated_energy")
    run.data.update({name: np.linspace(0.0, 1.0, len(run.time)) for name in names})
    figure = plotting.chain_deployment(run)
    assert len(figure.axes) == 4
    check_axes(figure)
    keys = [ax.get_legend() for ax in plotting.chain_energies(run).axes]
    assert "winch" in [text.get_text() for key in keys if key is not None for text in key.get_texts()]


@pytest.mark.parametrize("make", FIGURES, ids=lambda make: make.__name__)
@pytest.mark.parametrize("name", CHAINS)
def test_every_axis_of_a_chains_figures_says_what_it_shows(chains, make, name):
    """All chains have all figures, but only a chain in orbit has libration angles."""
    figure = make(chains[name])
    on_orbit = name in ("satellite", "failed")
    assert bool(figure.axes) == (on_orbit or make is not plotting.chain_libration)
    check_axes(figure)


def test_plot_draws_rods_and_joints_of_a_chain(chains):
    run = chains["hanging"]
    ax = esail_jax.plot(run, "tension", ax=Figure().add_subplot())
    assert ax.get_ylabel() == "tension, $N$ [N]" and ax.get_xlabel() == "time $t$ [s]"
    np.testing.assert_array_equal([line.get_ydata() for line in ax.lines], run["tension"].T)
    ax = esail_jax.plot(run, "joint_position", ax=Figure().add_subplot())
    assert len(ax.lines) == 12 * 3
    assert list(esail_jax.plot(chains["one rod"])) == [
        make.__name__ for make in FIGURES if make is not plotting.chain_libration
    ]
    with pytest.raises(
        ValueError, match=r"an observable of the run \(joint_position, .*energy_error\), but is"
    ):
        esail_jax.plot(run, "coning_angle")


@pytest.mark.parametrize("name", ["satellite", "one rod"])
def test_plot_all_draws_the_figures_of_a_chain(chains, tmp_path, monkeypatch, name):
    monkeypatch.setattr(plotting.figure_files, "DOTS_PER_INCH", 20)
    expected = [f"{make.__name__}.png" for make in FIGURES]
    if name != "satellite":
        expected.remove("chain_libration.png")
    paths = plotting.plot_all(chains[name], tmp_path)
    assert [path.name for path in paths] == expected
    for path in paths:
        assert matplotlib.image.imread(path).std() > 0.0


def test_a_single_instant_is_a_dot(chains):
    """A single instant is drawn as a dot, because a line through one point is invisible."""
    for name, marker in (("start only", "."), ("hanging", "")):
        lines = [line for ax in plotting.chain_tension(chains[name]).axes for line in ax.lines]
        assert {line.get_marker() for line in lines} == {marker}


def test_nothing_is_written_of_a_chain_without_data(chains, tmp_path):
    assert plotting.plot_all(rows_of(chains["satellite"], lost_from(0)), tmp_path) == []


def test_shapes_show_the_chain_and_the_path_of_its_tip(chains):
    """Shapes are drawn in the plane of motion with equal scales; a failed run shows its good rows."""
    run = chains["hanging"]
    ax, key = plotting.chain_shapes(run, instants=4).axes
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_aspect()) == ("$x$ [m]", "$y$ [m]", 1.0)
    joints = run["joint_position"][..., :2]
    assert len(ax.lines) == 1 + 2 * 4
    np.testing.assert_array_equal(np.transpose(ax.lines[0].get_data()), joints[:, -1])
    for line, row in zip(ax.lines[1::2], (0, 5, 10, 15), strict=True):
        np.testing.assert_array_equal(np.transpose(line.get_data()), joints[row])
    assert key.get_ylim() == pytest.approx((0.0, 0.3))
    last = np.transpose(panels(plotting.chain_shapes(chains["failed"]))["$z$ [km]"].lines[-2].get_data())
    np.testing.assert_allclose(last, chains["failed"]["joint_position"][19][:, ::2] / 1e3)


def test_shapes_are_in_the_planes_with_the_most_extent(chains):
    """The plane has the directions of the largest extents, here z and x.

    With equal scales 20 km by 300 m would be a line.
    """
    turn = lambda values: values[..., [1, 2, 0]] * [2.0, 1.0, 1.0] if values.ndim == 3 else values  # noqa: E731
    first, second, _ = plotting.chain_shapes(rows_of(chains["satellite"], turn)).axes
    assert (first.get_xlabel(), first.get_ylabel()) == ("$x$ [km]", "$z$ [km]")
    assert (second.get_xlabel(), second.get_ylabel()) == ("$y$ [km]", "$z$ [km]")
    assert first.get_aspect() == "auto"
    assert first.get_title() == "different scales"


def test_tip_of_a_free_chain_is_seen_from_its_first_joint(chains):
    run, period = chains["satellite"], 2.0 * np.pi / 1.1e-3
    joints = run["joint_position"]
    assert np.abs(joints[:, 0]).max() > 1e3
    for axis, name in enumerate("xyz"):
        shown = panels(plotting.chain_tip(run))[f"${name}_{{tip}}$ [km]"].lines[0]
        np.testing.assert_allclose(shown.get_ydata(), (joints[:, -1] - joints[:, 0])[:, axis] / 1e3)
        np.testing.assert_allclose(shown.get_xdata(), run.time / period)


def test_tip_of_a_hanging_chain_is_in_metres_and_seconds(chains):
    run = chains["hanging"]
    shown = panels(plotting.chain_tip(run))["$y_{tip}$ [m]"].lines[0]
    np.testing.assert_array_equal(shown.get_ydata(), run["joint_position"][:, -1, 1])
    np.testing.assert_array_equal(shown.get_xdata(), run.time)


def test_tension_of_three_rods_and_of_all(chains):
    run = chains["hanging"]
    some, extremes = plotting.chain_tension(run).axes
    np.testing.assert_array_equal([line.get_ydata() for line in some.lines], run["tension"].T[[0, 5, 10]])
    assert [line.get_label() for line in some.lines] == ["rod 1", "rod 6", "rod 11"]
    most, least = (line.get_ydata() for line in extremes.lines)
    assert (most[:, None] >= run["tension"]).all() and (least[:, None] <= run["tension"]).all()
    assert (most > least).any()
    (only,) = plotting.chain_tension(chains["one rod"]).axes
    assert len(only.lines) == 1


def test_energies_of_a_chain_add_up(chains):
    """The potential energy is drawn relative to its start, and the total energy is constant."""
    run = chains["satellite"]
    shown = panels(plotting.chain_energies(run))
    kinetic, elastic, potential, total = (line.get_ydata() for line in shown["energy [J]"].lines)
    np.testing.assert_array_equal(kinetic, run["kinetic_energy"])
    np.testing.assert_array_equal(elastic, run["elastic_energy"])
    np.testing.assert_allclose(np.diff(potential), np.diff(run["potential_energy"]), atol=1e-9)
    assert np.ptp(potential) > 1.0
    np.testing.assert_allclose(total, kinetic[0] + elastic[0], rtol=1e-6)
    error = shown["energy error $e_E$ [-]"].lines[0].get_ydata()
    np.testing.assert_array_equal(error, run["energy_error"])


def test_work_is_shown_where_there_is_some(chains):
    assert len(plotting.chain_energies(chains["hanging"]).axes) == 2
    run = chains["one rod"]
    shown = panels(plotting.chain_energies(run))
    assert len(shown) == 4
    supplied, lost = (line.get_ydata() for line in shown["work [J]"].lines)
    np.testing.assert_array_equal(supplied, run["external_work"])
    np.testing.assert_array_equal(lost, run["dissipated_energy"])
    assert lost[-1] > 0.0
    balance = shown[r"$\Delta(T + U) - W + E_d$ [J]"].lines[0].get_ydata()
    np.testing.assert_array_equal(balance, run["energy_balance_error"])


def test_libration_angles_of_known_lines():
    """Libration angles depend on the first and last joint only.

    The lines point half-way up over the diagonal, forward, down along the normal, and backward past the
    vertical.
    """
    lines = np.array([[1.0, 1.0, np.sqrt(2.0)], [0.0, 5.0, 0.0], [0.0, 0.0, -3.0], [-2.0, -2.0, 0.0]])
    first = np.array([7.0, -4.0, 2.0])
    joints = np.stack([0.0 * lines + first, lines[:, ::-1] ** 2, lines + first], axis=1)
    inside, across = np.degrees(libration_angles(joints))
    np.testing.assert_allclose(inside[[0, 1, 3]], [45.0, 90.0, -135.0], rtol=1e-13)
    np.testing.assert_allclose(across, [45.0, 0.0, -90.0, 0.0], rtol=1e-13, atol=1e-13)


def test_drawn_libration_is_that_of_the_run(chains):
    """The drawn angles start at 0.01 rad in both planes; the angle of a tumbling chain has no jumps."""
    run = chains["satellite"]
    for ax, angle in zip(
        plotting.chain_libration(run).axes, libration_angles(run["joint_position"]), strict=True
    ):
        np.testing.assert_allclose(ax.lines[0].get_ydata(), np.degrees(angle))
        assert ax.lines[0].get_ydata()[0] == pytest.approx(np.degrees(0.01), rel=1e-3)
    count = len(run.time)
    turn = np.linspace(0.0, 12.0, count)
    joints = np.zeros((count, 2, 3))
    joints[:, 1, :2] = 5.0 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    tumbling = FakeRun(run.scene, run.time, {"joint_position": joints})
    inside = plotting.chain_libration(tumbling).axes[0].lines[0].get_ydata()
    np.testing.assert_allclose(inside, np.degrees(turn), atol=1e-9)
