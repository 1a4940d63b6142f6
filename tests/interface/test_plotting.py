"""Figures of small runs, and the computations behind them. The runs of a sail are synthetic.

The rigid pendulum is compared with closed forms of its equations, its equations with Newton's law for a
point mass on a rod, and the spectrum with a sine.
"""

import dataclasses
import subprocess
import sys

import matplotlib.image
import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.figure import Figure
from matplotlib.mathtext import MathTextParser
from scipy.integrate import solve_ivp

import esail_jax
from esail_jax import plotting, simulate
from esail_jax.observables import chain, sail
from esail_jax.observables.rigid_pendulum import hinge_moments, inertia, rigid_pendulum, swing
from esail_jax.plotting.chain import libration_angles
from esail_jax.plotting.data import power_spectrum, readable
from esail_jax.plotting.single import mathtext
from esail_jax.scenes.scene import RemoteUnits, load_scene

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
    """Returns a run of smooth, invented signals with the names and shapes of a sail's observables."""
    count = scene.tethers.count
    turn, rng = 2.0 * np.pi * TIME / PERIOD, np.random.default_rng(0)

    def wave(*shape, mean=0.0, size=1.0):
        phase = rng.uniform(0.0, 6.0, shape)
        return mean + size * np.sin(turn.reshape(-1, *[1] * len(shape)) + phase)

    scalars = (
        "sailing_angle thrust_angle reaction_angle kinetic_energy elastic_energy dissipated_power "
        "external_power dissipated_energy external_work energy_balance_error precession_angle "
        "smallest_tether_distance"
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
    data["tip_position_I"] = 10e3 * wave(count, 3)
    if scene.hub is None:
        data = {name: values for name, values in data.items() if name not in OF_HUB}
    if count < 3:
        data["euler_sail"] = np.full((len(TIME), 3), np.nan)
        data["precession_angle"] = np.full(len(TIME), np.nan)
    if count < 2:
        data["smallest_tether_distance"] = np.full(len(TIME), np.nan)
    return FakeRun(scene, TIME, data)


def no_spin():
    initial = dataclasses.replace(load_scene("baseline").initial, spin_rate=0.0)
    run = make_run(scene_of(initial=initial))
    for name in run.data:
        if "thrust" in name or "external" in name:
            run.data[name] = 0.0 * run.data[name]
    return run


def failed_at(index):
    run = make_run(scene_of())
    for name, values in run.data.items():
        run.data[name] = values.copy()
        run.data[name][index:] = np.nan
    return run


def start_only():
    run = make_run(scene_of())
    return FakeRun(run.scene, TIME[:1], {name: values[:1] for name, values in run.data.items()})


def different_tethers():
    scene = scene_of(remote_units=RemoteUnits(mass=(1.0, 2.0, 0.0)))
    tethers = dataclasses.replace(scene.tethers, length=(9e3, 10e3, 11e3))
    return make_run(dataclasses.replace(scene, tethers=tethers))


RUNS = {
    "full": different_tethers,
    "no hub": lambda: make_run(scene_of(hub=None)),
    "one tether": lambda: make_run(scene_of(1, hub=None, remote_units=None)),
    "no spin, no wind": no_spin,
    "failed": lambda: failed_at(30),
    "start only": start_only,
}


# ---- figures ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def runs():
    return {name: make() for name, make in RUNS.items()}


@pytest.mark.parametrize("make", plotting.FIGURES, ids=lambda make: make.__name__)
@pytest.mark.parametrize("name", RUNS)
def test_every_axis_says_what_it_shows(runs, make, name):
    figure = make(runs[name])
    assert figure.axes
    check_axes(figure)


def check_axes(figure):
    """Every axis has a label with a unit that can be typeset, and every panel has a line."""
    for ax in figure.axes:
        assert ax.get_ylabel().endswith("]")
        MathTextParser("path").parse(ax.get_ylabel())
        if ax.get_label() != "<colorbar>":
            assert ax.get_xlabel().endswith("]") or shares_a_labelled_axis(ax)
            assert ax.lines


def shares_a_labelled_axis(ax):
    """Tells whether a panel further down in the same column has the same x axis and labels it."""
    left, bottom = ax.get_position().x0, ax.get_position().y0
    return any(
        other.get_xlabel().endswith("]")
        and np.isclose(other.get_position().x0, left, atol=0.01)
        and other.get_position().y0 < bottom
        for other in ax.get_shared_x_axes().get_siblings(ax)
    )


def panels(figure):
    return {ax.get_ylabel(): ax for ax in figure.axes}


def test_tether_motion_shows_the_chosen_tether_in_degrees_and_spin_periods(runs):
    run = runs["full"]
    shown = panels(plotting.tether_motion(run, tether=1))
    assert len(shown) == 10
    time, angle = shown[r"$\gamma_{2}$ [deg]"].lines[0].get_data()
    np.testing.assert_allclose(time, TIME * 4e-3 / (2.0 * np.pi))
    np.testing.assert_allclose(angle, np.degrees(run["coning_angle"][:, 1]))
    rigid = shown[r"$\beta_{2}$ [deg]"].lines[1].get_data()
    np.testing.assert_allclose(rigid[1], np.degrees(rigid_pendulum(run, 1)[2]))
    dashed = shown[r"PSD of $\gamma_{2}$ [deg$^2$/Hz]"].lines[1].get_xdata()
    np.testing.assert_allclose(dashed, 1.0 / PERIOD)


def test_length_is_divided_by_that_of_the_tether(runs):
    run = runs["full"]
    shown = panels(plotting.tether_motion(run, tether=2))["$L/L_0$ [-]"].lines[0].get_ydata()
    np.testing.assert_allclose(shown, run["tether_length"][:, 2] / 11e3)


def test_without_spin_time_is_in_seconds_and_nothing_rigid_turns(runs):
    figure = plotting.tether_motion(runs["no spin, no wind"])
    ax = panels(figure)[r"$\gamma_{1}$ [deg]"]
    assert len(ax.lines) == 1
    np.testing.assert_allclose(ax.lines[0].get_xdata(), TIME)


def test_absent_data_leaves_no_panel(runs):
    assert len(plotting.attitude(runs["full"]).axes) == 8
    assert len(plotting.attitude(runs["no hub"]).axes) == 5
    assert len(plotting.attitude(runs["one tether"]).axes) == 1
    assert len(plotting.tether_motion(runs["start only"]).axes) == 5
    assert r"$d_{min}$ [km]" not in panels(plotting.all_tethers(runs["one tether"]))


def test_energies_start_at_zero_and_euler_angles_do_not_jump(runs):
    run = runs["full"]
    total = panels(plotting.energies(run))["$E_T - E_T(0)$ [J]"].lines[0].get_ydata()
    energy = run["kinetic_energy"] + run["elastic_energy"]
    np.testing.assert_allclose(total, energy - energy[0], atol=1e-12)
    turning = np.stack([TIME * 4e-3] * 3, axis=1)
    wrapped = np.angle(np.exp(1j * turning))
    turned = FakeRun(run.scene, TIME, run.data | {"euler_hub": wrapped})
    phi = panels(plotting.attitude(turned))[r"$\phi$ [deg]"].lines[0].get_ydata()
    np.testing.assert_allclose(phi, np.degrees(turning[:, 2]))


def test_plot_all_writes_png_files(runs, tmp_path, monkeypatch):
    monkeypatch.setattr(plotting, "DOTS_PER_INCH", 20)
    paths = plotting.plot_all(runs["one tether"], tmp_path / "new" / "figures")
    assert [path.name for path in paths] == [f"{make.__name__}.png" for make in plotting.FIGURES]
    for path in paths:
        assert matplotlib.image.imread(path).std() > 0.0


def test_nothing_is_written_without_data(tmp_path):
    assert plotting.plot_all(failed_at(0), tmp_path) == []


# ---- plot -------------------------------------------------------------------------------------


def test_plot_draws_one_observable_with_its_unit_and_symbol(runs):
    """Into the axes that it is given, one coloured line per tether."""
    run, given = runs["full"], Figure().add_subplot()
    ax = esail_jax.plot(run, "coning_angle", ax=given)
    assert ax is given
    assert (ax.get_xlabel(), ax.get_ylabel()) == (r"time $t/T_s$ [-]", r"coning angle, $\gamma$ [rad]")
    for line, values in zip(ax.lines, run["coning_angle"].T, strict=True):
        np.testing.assert_allclose(line.get_xdata(), TIME / PERIOD)
        np.testing.assert_array_equal(line.get_ydata(), values)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["tether 1", "tether 2", "tether 3"]


def test_plot_makes_axes_if_it_is_given_none(runs):
    ax = esail_jax.plot(runs["full"], "kinetic_energy")
    assert len(ax.lines) == 1 and ax.get_legend() is None
    pyplot.close(ax.figure)


def names_in_legend(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_components_of_vectors_and_angles_are_named(runs):
    run, ax = runs["full"], Figure().add_subplot()
    assert names_in_legend(esail_jax.plot(run, "thrust_O", ax=ax)) == ["x", "y", "z"]
    assert ax.get_ylabel() == "thrust in O, $F_{c}$ [N]"
    angles = esail_jax.plot(run, "euler_hub", ax=Figure().add_subplot())
    assert names_in_legend(angles) == [r"$\psi$", r"$\theta$", r"$\phi$"]
    tips = esail_jax.plot(run, "tip_position_I", ax=Figure().add_subplot())
    assert names_in_legend(tips) == ["tether 1", "tether 2", "tether 3", "x", "y", "z"]
    np.testing.assert_array_equal(tips.lines[5].get_ydata(), run["tip_position_I"][:, 1, 2])
    assert tips.lines[5].get_linestyle() == ":"


@pytest.mark.parametrize(
    "entry", [*sail.OBSERVABLES, *chain.OBSERVABLES, chain.ENERGY_ERROR], ids=lambda x: x.name
)
def test_symbol_of_every_observable_can_be_typeset(entry):
    MathTextParser("path").parse(mathtext(entry.symbol))


def test_symbols_are_typeset_with_greek_letters_and_whole_indices():
    found = [
        mathtext(x)
        for x in ("F_lambda", "eps_max", "omega^B", "F_c,i", "dE - W + E_d", "psi, theta, phi", "beta'")
    ]
    assert found == [
        r"$F_{\lambda}$", r"$\epsilon_{max}$", r"$\omega^{B}$", "$F_{c,i}$", "$dE - W + E_{d}$",
        r"$\psi, \theta, \phi$", r"$\beta'$",
    ]  # fmt: skip


def test_plot_without_a_name_makes_the_overview(runs):
    """The figures that `esail plot` writes; without a hub the attitude is still there."""
    figures = esail_jax.plot(runs["no hub"])
    assert list(figures) == [make.__name__ for make in plotting.FIGURES]
    assert esail_jax.plot(failed_at(0)) == {}


def test_plot_refuses_what_it_cannot_draw(runs):
    run = runs["no hub"]
    with pytest.raises(ValueError, match=r"`name` must be one of coning_angle, .*, but is 'euler_hub'"):
        esail_jax.plot(run, "euler_hub")
    with pytest.raises(ValueError, match=r"`name` must be given with `ax`, but is None"):
        esail_jax.plot(run, ax=Figure().add_subplot())
    with pytest.raises(ValueError, match=r"`solution` must have a scene, but was computed under a trace"):
        esail_jax.plot(FakeRun(None, run.time, run.data), "voltage")


def test_the_package_does_not_import_matplotlib_by_itself():
    program = "import sys, esail_jax; assert 'matplotlib' not in sys.modules; esail_jax.plot"
    subprocess.run([sys.executable, "-c", program], check=True)
    with pytest.raises(AttributeError, match="no attribute 'plots'"):
        esail_jax.plots  # noqa: B018


# ---- rod chains -------------------------------------------------------------------------------

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
    """Returns a copy with changed rows."""
    data = {name: change(np.array(run[name])) for name in run.observables}
    return FakeRun(run.scene, np.asarray(run.time)[: len(data["tension"])], data)


def lost_from(index):
    def change(values):
        values[index:] = np.nan
        return values

    return change


@pytest.fixture(scope="module")
def chains():
    found = {
        name: simulate(scene, changes | {"integrator.method": "dopri5"})
        for name, (scene, changes) in SHORT.items()
    }
    found["failed"] = rows_of(found["satellite"], lost_from(20))
    found["start only"] = rows_of(found["hanging"], lambda values: values[:1])
    return found


@pytest.mark.parametrize("make", plotting.CHAIN_FIGURES, ids=lambda make: make.__name__)
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
        make.__name__ for make in plotting.CHAIN_FIGURES if make is not plotting.chain_libration
    ]
    with pytest.raises(ValueError, match=r"`name` must be one of joint_position, .*energy_error, but is"):
        esail_jax.plot(run, "coning_angle")


@pytest.mark.parametrize("name", ["satellite", "one rod"])
def test_plot_all_draws_the_figures_of_a_chain(chains, tmp_path, monkeypatch, name):
    monkeypatch.setattr(plotting, "DOTS_PER_INCH", 20)
    expected = [f"{make.__name__}.png" for make in plotting.CHAIN_FIGURES]
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


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([12345.0, -2.0], (1e-3, "kN")),
        ([-999.0, np.nan], (1.0, "N")),
        ([0.02, np.inf], (1e3, "mN")),
        ([3e-5], (1e6, r"$\mu$N")),
        ([0.0], (1.0, "N")),
    ],
)
def test_units_suit_the_largest_value(values, expected):
    factor, unit = readable("N", np.array([0.0]), np.array(values))
    assert (pytest.approx(factor), unit) == expected


# ---- rigid pendulum ---------------------------------------------------------------------------


def test_constant_flapping_moment_has_a_closed_form():
    """A constant flapping moment gives gamma = A (1 - cos W t) with W = w sqrt(1 + eps), A = m / W^2.

    The coupling 2 w A^2 W (sin W t - sin(2 W t) / 2) then drives the lagging oscillator of frequency
    n = w sqrt(eps).
    """
    rate, eps, flap = 4e-3, 0.3, 2e-7
    fast, slow = rate * np.sqrt(1.0 + eps), rate * np.sqrt(eps)
    size = flap / fast**2
    drive = 2.0 * rate * size**2 * fast
    first, second = drive / (slow**2 - fast**2), -drive / 2.0 / (slow**2 - 4.0 * fast**2)
    free = -(fast * first + 2.0 * fast * second) / slow
    gamma, beta = swing(TIME, rate, eps, lambda _: np.array([flap, 0.0]), (0.0, 0.0))
    np.testing.assert_allclose(gamma, size * (1.0 - np.cos(fast * TIME)), atol=1e-7 * size)
    expected = first * np.sin(fast * TIME) + second * np.sin(2.0 * fast * TIME) + free * np.sin(slow * TIME)
    np.testing.assert_allclose(beta, expected, atol=1e-6 * np.abs(expected).max())


def test_constant_lagging_moment_of_a_run_has_a_closed_form():
    """A constant lagging moment adds beta = (M_X / I) (1 - cos n t) / n^2, n = w sqrt(eps), to the free
    swing."""
    scene = scene_of()
    run = make_run(scene)
    zero = np.zeros((len(TIME), 3))
    moment = np.zeros((len(TIME), 3, 3))
    moment[:, 1, 0] = 0.02
    run.data |= {"thrust_moment_B": moment, "coning_angle": zero, "lagging_angle": zero + 0.01}
    mass = 7653.0 * 4.28e-9 * 10e3
    total = (1.5 + mass / 3.0) * 1e8
    slow = 4e-3 * np.sqrt(1e-4 * (1.5 + mass / 2.0) / (1.5 + mass / 3.0))
    times, gamma, beta = rigid_pendulum(run, 1)
    expected = 0.01 * np.cos(slow * times) + 0.02 / total * (1.0 - np.cos(slow * times)) / slow**2
    np.testing.assert_allclose(beta, expected, rtol=1e-7)
    np.testing.assert_allclose(gamma, 0.0, atol=1e-15)


@pytest.mark.parametrize(("azimuth", "side"), [(0.0, 0.0), (2.0, 0.3)])
def test_equations_follow_from_newtons_law(azimuth, side):
    """The equations agree with Newton's law for a point mass on a massless rod in inertial axes.

    Body-fixed forces act on the mass: across the plane, where only the coupling moves the rod in the
    plane, and with a component along the spin.
    """
    rate, radius, length, mass = 4e-3, 3e3, 10e3, 1.5
    force_B = 3e-3 * np.array([1.0, -side * np.sin(azimuth), side * np.cos(azimuth)])

    def body_axes(time):
        c, s = np.cos(rate * time), np.sin(rate * time)
        return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])

    outward = np.array([0.0, np.cos(azimuth), np.sin(azimuth)])
    spin = np.array([rate, 0.0, 0.0])

    def slope(time, state):
        hinge = radius * body_axes(time) @ outward
        rod = state[:3] - hinge
        rod_rate = state[3:] - np.cross(spin, hinge)
        free = body_axes(time) @ force_B / mass
        pull = (rod_rate @ rod_rate + rod @ (free + rate**2 * hinge)) / length**2
        return np.concatenate([state[3:], free - pull * rod])

    tip = (radius + length) * outward
    solution = solve_ivp(
        slope,
        (0.0, TIME[-1]),
        np.concatenate([tip, np.cross(spin, tip)]),
        method="DOP853",
        t_eval=TIME,
        rtol=1e-11,
        atol=1e-9,
    )
    rods = np.array([body_axes(t).T @ x for t, x in zip(TIME, solution.y[:3].T, strict=True)])
    rods = rods - radius * outward
    sideways = np.array([0.0, -np.sin(azimuth), np.cos(azimuth)])
    coning, lagging = np.arcsin(rods[:, 0] / length), np.arctan2(rods @ sideways, rods @ outward)

    moments = hinge_moments(np.cross(rods, force_B), azimuth)
    forcing = np.stack(moments, axis=1) / (mass * length**2)
    gamma, beta = swing(
        TIME,
        rate,
        radius / length,
        lambda t: [np.interp(t, TIME, column) for column in forcing.T],
        (0.0, 0.0),
    )
    # The equations neglect third powers of the angles and 2 w gamma beta'.
    error = 3.0 * coning.max() ** 2 + 2.0 * np.abs(lagging).max()
    assert error < 0.1
    assert np.abs(lagging).max() > 1e-4
    np.testing.assert_allclose(gamma, coning, atol=error * coning.max())
    np.testing.assert_allclose(beta, lagging, atol=error * np.abs(lagging).max())


def test_inertia_of_the_baseline():
    """I and eps are those of a rod with a point mass, found by summation; R = 0 without a hub."""
    lengths = (np.arange(20000) + 0.5) / 20000 * 10e3
    unit = 7653.0 * 4.28e-9 * 10e3 / 20000
    second = 1.5 * 1e8 + unit * (lengths**2).sum()
    first = 1.5 * 1e4 + unit * lengths.sum()
    total, eps = inertia(scene_of(), 0)
    np.testing.assert_allclose(total, second, rtol=1e-8)
    np.testing.assert_allclose(eps, 1.0 * first / second, rtol=1e-8)
    assert inertia(scene_of(hub=None), 0)[1] == 0.0


# ---- spectrum ---------------------------------------------------------------------------------


def test_spectrum_peaks_where_the_sine_is_and_holds_its_power():
    """The spectrum of 50 whole periods, 500 samples, ignores the shorter last interval."""
    time = np.append(np.arange(500) * 2.0, 999.0)
    signal = 3.0 + 0.2 * np.sin(2.0 * np.pi * 0.05 * time)
    frequency, density = power_spectrum(time, signal)
    assert frequency[np.argmax(density)] == pytest.approx(0.05, rel=1e-12)
    assert density.sum() * frequency[0] == pytest.approx(0.5 * 0.2**2, rel=1e-9)
    assert np.sort(density)[-2] < 1e-12 * density.max()


def test_no_spectrum_of_short_or_constant_signals():
    time = np.arange(20.0)
    assert power_spectrum(time[:7], time[:7]) is None
    assert power_spectrum(time, np.full(20, 0.1)) is None
    assert power_spectrum(time, np.zeros(20)) is None
    assert power_spectrum(time, np.where(time < 5.0, time, np.nan)) is None
