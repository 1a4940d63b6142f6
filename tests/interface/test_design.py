"""Designs: gradients of all objectives, results of an optimisation, and resuming.

All scenes have the same structure, and three programs hold a derivative: that of the design `torque`, which
the command shares; that of a design with circumstances; and that of all objectives.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

import esail_jax as esail
from esail_jax.cli import main
from esail_jax.design import Design, Objective, Variable, objectives
from esail_jax.design.design_file import read_history
from esail_jax.design.optimiser import Optimiser
from esail_jax.design.problem import coordinate_of_start, value_of
from esail_jax.scenes.loading import read_scene
from esail_jax.scenes.toml_text import to_toml
from esail_jax.simulation.solution import Solution
from esail_jax.steppers.results import RESULTS
from support.new_process import output_of
from support.quick import jit

CALM = {
    "solar_wind.time": [0.0, 200.0, 400.0],
    "solar_wind.speed": [4e5] * 3,
    "solar_wind.number_density": [7.3e6] * 3,
    "tethers.length": [10e3] * 3,
}
"""The steady wind and equal tethers, as a wind in time and as one length per tether: the structure of the
circumstances below."""

SMALL = CALM | {
    "tethers.count": 3,
    "tethers.elements": 2,
    "integrator.t_end": 400.0,
    "output.interval": 20.0,
    "integrator.tolerance": 1e-8,
    "voltage.law": "harmonic",
    "voltage.cosine": [0.05],
    "voltage.sine": [0.02],
    "voltage.maximum": 40e3,
}
FREE = {"voltage.cosine": Variable([0.0], 0.1), "voltage.sine": Variable([0.0], 0.1)}


def problem(**changes):
    settings = {"weights": {"mean-torque": 1.0, "thrust": 1.0}} | changes
    return Design(esail.load_scene("baseline", SMALL), variables=FREE, **settings)


@pytest.fixture(scope="module", autouse=True)
def _compiled_quickly():
    """Objectives are compiled with the options for programs that run a few times."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("esail_jax.design.problem.jit", jit)
        yield


@pytest.fixture(scope="module")
def torque():
    return problem()


@pytest.fixture(scope="module")
def optimised(torque):
    """The states of four iterations from zero modulation and from two starts near it."""
    return list(torque.optimise(4, starts=3, seed=5))


def test_a_variable_keeps_its_limits():
    """A variable lies between its limits by construction, and starts where it is told to."""
    for variable in (Variable([0.2, 0.9], 0.1, 0.0, 1.0), Variable([3.0], 2.0)):
        assert np.allclose(value_of(variable, coordinate_of_start(variable)), variable.start, rtol=1e-12)
    held = Variable([[0.5, 1.0]], 0.1, [[0.0, 1.0]], [[2.0, 1.0]])
    assert np.allclose(value_of(held, coordinate_of_start(held)), held.start, rtol=1e-12)
    assert value_of(held, np.full((1, 2), 3.0))[0, 1] == 1.0
    far = value_of(Variable([0.5], 0.1, 0.0, 2.0), np.linspace(-1e3, 1e3, 999))
    assert far.min() >= 0.0 and far.max() <= 2.0


@pytest.mark.parametrize("method", ["lbfgs", "adam"])
def test_no_step_leads_to_where_there_is_no_gradient(method):
    """(x - 1)^2, whose gradient is not defined beyond 0.5: the descent comes close to there. With a
    gradient that is not a number it could go nowhere from the first such point, which was near 0.7."""

    def evaluate(x):
        slope = jnp.where(x > 0.5, jnp.nan, 2.0 * (x - 1.0))
        return ((x - 1.0) ** 2).sum(1), slope

    optimiser = Optimiser(evaluate, method, 0.2)
    state = optimiser.init(np.zeros((1, 1)))
    for _ in range(20):
        state = optimiser.step(state)
        assert np.isfinite(state.gradient).all()
    assert 0.45 < state.x[0, 0] <= 0.5


@pytest.mark.nightly
def test_mean_torque_is_cancelled(torque, optimised):
    """A first harmonic of 0.5 % cancels the mean torque and keeps the thrust.

    The objective, a mean over time, falls by ten orders of magnitude in four iterations. Without
    modulation, at the first start, the torque term is one by definition and the thrust term zero.
    """
    states = optimised
    assert abs(float(states[0].value[0]) - 1.0) < 1e-6
    assert float(states[-1].value[0]) < 1e-10
    after = esail.simulate(torque.scene_at(states[-1].x[0]))
    found = objectives.values(after, ("mean-torque", "thrust"))
    assert found["mean-torque"] < 1e-6 * torque.objective.reference_values["mean-torque"]
    assert found["thrust"] > 0.99 * torque.objective.reference_values["thrust"]
    amplitude = np.abs(torque.scene_at(states[-1].x[0]).voltage.cosine[0])
    assert 1e-4 < amplitude < 0.1


def test_a_design_simulates_nothing_before_it_is_needed(monkeypatch):
    """Neither a design nor an objective simulates when it is made; names are checked at once."""

    def simulate_nothing(*_):
        raise AssertionError("simulated")

    monkeypatch.setattr("esail_jax.design.objective.simulate", simulate_nothing)
    design = problem()
    assert design.scene_at(design.start).voltage.cosine == (0.0,)
    with pytest.raises(esail.SceneError, match="`objective` must be one of"):
        Objective(design.scene, {"speed": 1.0})
    with pytest.raises(esail.SceneError, match=r"`voltage.value` must be given for a design"):
        Objective(esail.load_scene("voltage-off"), {"spin": 1.0})
    with pytest.raises(esail.SceneError, match="`chain` must be left out of a design, but is given"):
        Objective(esail.load_scene("steel-chain"), {"spin": 1.0})


def test_an_objective_takes_a_scene_as_simulate_does(tmp_path):
    """A name, a path or a `Scene`; also a file that leaves its law to the parameters."""
    text = to_toml(read_scene("baseline", {"voltage.law": "python", "voltage.maximum": 40e3}))
    (tmp_path / "own.toml").write_text(text, encoding="utf-8")
    assert Objective("baseline", {"spin": 1.0}).scene == esail.load_scene("baseline")
    for source in (tmp_path / "own.toml", str(tmp_path / "own.toml")):
        assert Objective(source, {"spin": 1.0}).scene.voltage.maximum == 40e3
        assert Design(source, {"spin": 1.0}, FREE).scene.voltage.law == "python"
    with pytest.raises(esail.SceneError, match=r"`no\.toml` must be a built-in scene or a TOML file"):
        Objective("no.toml", {"spin": 1.0})
    (tmp_path / "own.toml").write_text(text.replace("value = 20000.0\n", ""), encoding="utf-8")
    with pytest.raises(esail.SceneError, match=r"`voltage.value` must be given for a design, but is miss"):
        Objective(tmp_path / "own.toml", {"spin": 1.0})


def angles(run):
    return run["sailing_angle"]


@pytest.mark.parametrize("circumstances", [{}, {"solar_wind.speed": np.array([4e5, 5e5])}])
@pytest.mark.parametrize(
    ("goal", "value", "got"),
    [
        ("thrust", 0.0, "thrust is 0"),
        ("mean-torque", 2.8e-27, "mean-torque is 2.8e-27"),
        ("lagging", np.nan, "lagging is nan"),
        (angles, -0.17, "angles is -0.17"),
    ],
)
def test_an_objective_that_is_zero_at_constant_voltage_is_refused(
    goal, value, got, circumstances, monkeypatch, nothing_compiles
):
    """Its ratio to constant voltage would be infinite, rounding over rounding, or of the wrong sign."""
    monkeypatch.setattr(Objective, "simulate_reference", lambda *_: None)
    monkeypatch.setattr(Objective, "reference_run", None)
    monkeypatch.setattr(Objective, "measure", lambda *_: {goal: value, "power": 2.0})
    objective = Objective("baseline", {goal: 1.0, "power": 1.0}, circumstances)
    with pytest.raises(esail.SceneError, match="by which it is divided, but " + got) as caught:
        objective({})
    assert "\n" not in str(caught.value)


def test_an_objective_is_one_number(nothing_compiles):
    given = {"angles": np.zeros(3), "none": None, "text": "3"}
    for value, got in zip(given.values(), ("array of shape (3,)", "NoneType", "str"), strict=True):
        with pytest.raises(esail.SceneError, match="`objective` must return one number") as caught:
            objectives.one_number(angles, value)
        assert "but angles returned a" in str(caught.value) and got in str(caught.value)
    assert objectives.one_number(angles, 2.0) == 2.0


def test_what_is_no_dictionary_by_scene_key_is_refused_in_one_line():
    """In a process of its own, without the checks of types that the tests add: a law in the place of
    overrides or parameters, something else there, and a number of a law as a key."""
    code = """
import equinox as eqx
import esail_jax as esail
class Steer(eqx.Module):
    gain: float = 1.0
    def commanded(self, measurements):
        return 20e3
for call in (
    lambda: esail.simulate("baseline", Steer()),
    lambda: esail.simulate("baseline", Steer(), voltage_law=Steer()),
    lambda: esail.design.Objective("baseline", {"spin": 1.0})(Steer()),
    lambda: esail.load_scene("baseline", 3.0),
    lambda: esail.load_scene("baseline", {"voltage_law.gain": 2.0}),
):
    try:
        call()
    except esail.SceneError as error:
        print(error)
"""
    law = "must be a dictionary by scene key, but is a Steer (a law is given as"
    assert output_of(code).splitlines() == [
        f"`overrides` {law} `voltage_law=law`)",
        f"`overrides` {law} `voltage_law=law`)",
        f'`parameters` {law} {{"voltage_law": law}})',
        "`overrides` must be a dictionary by scene key, but is a float",
        "`voltage_law.gain` must be left out: the numbers of a law are given as a whole, by the argument "
        "`voltage_law`, but is given",
    ]


@pytest.mark.nightly
def test_bare_objective_for_any_optimiser(torque):
    """The objective is a function of a dictionary by scene key. Traced and concrete values agree, its
    value is 1 without modulation, its gradient is the fourth-order difference quotient, and optax
    minimises it.

    The design `torque` compiles `jax.value_and_grad` of it, for three points x with amplitudes 0.1 x.
    """
    objective = torque.objective

    def of(x):
        value, slope = torque.optimiser.evaluate(jnp.stack([x, x0, x0]))
        return (value[0], slope[0]), value[1]

    x0, at, along = jnp.zeros(2), jnp.array([0.3, -0.1]), np.array([1.0, 0.5])
    (value, slope), unmodulated = of(at)
    assert abs(value / objective(torque.parameters_at(at)) - 1.0) < 1e-7
    assert abs(unmodulated - 1.0) < 1e-6
    e = 1e-2
    ends = [objective(torque.parameters_at(at + s * e * along)) for s in (-2, -1, 1, 2)]
    quotient = (8.0 * (ends[2] - ends[1]) - (ends[3] - ends[0])) / (12.0 * e)
    assert abs(slope @ along / quotient - 1.0) < 1e-5
    # The gradient of the bare function has the form of its argument.
    start = torque.parameters_at(at)
    assert jax.eval_shape(jax.grad(objective), start) == jax.eval_shape(lambda p: p, start)
    parameters, optimiser = x0, optax.adam(1e-3)
    state = optimiser.init(parameters)
    for _ in range(5):
        changes, state = optimiser.update(of(parameters)[0][1], state)
        parameters = optax.apply_updates(parameters, changes)
    assert of(parameters)[0][0] < 0.3


@pytest.mark.parametrize("name", ["spin-plane:13", "spin", "final-attitude"])
def test_an_objective_without_its_observables_is_refused(name):
    """A sail without a hub has neither the attitude of one nor its angular velocity. A mistake in an
    objective of the user's own stays what it is."""
    rows = {"coning_angle": np.zeros((2, 3))}
    run = Solution(np.arange(2.0), rows, RESULTS.successful, None, {}, scene=esail.load_scene("baseline"))
    with pytest.raises(esail.SceneError, match="`objective` must measure what the run has, but " + name):
        objectives.values(run, (name,))
    with pytest.raises(KeyError):
        objectives.values(run, (lambda run: {}["mine"],))


@pytest.mark.parametrize("name", ["spin-plane:13", "spin"])
def test_an_objective_without_its_observables_is_refused_before_a_run(name):
    """The observables of a run are known from its scene, so nothing has to be simulated to know that they
    lack what an objective measures."""
    no_hub = esail.load_scene("baseline").replace({"hub": None})
    with pytest.raises(
        esail.SceneError, match=name + r".* is no observable of this run .only with \[hub\]"
    ):
        Objective(no_hub, {name: 1.0, "thrust": 1.0})


def forces(size):
    """A run with these forces at the roots of two tethers (time, tether) [N], in any direction."""
    rows = {"reaction_B": np.asarray(size)[..., None] * np.array([0.6, 0.0, -0.8])}
    time = np.arange(float(len(size)))
    return Solution(time, rows, RESULTS.successful, None, {}, scene=esail.load_scene("baseline"))


def test_a_limit_of_the_tension_costs_the_square_of_the_percents_outside():
    """The least force is 4 % below a lower limit of 0.5 N, the largest one 3 % above an upper one of 2 N:
    16 + 9. Within its limits it costs nothing, and only forces at a limit have a derivative."""
    size = np.array([[0.48, 1.0], [1.0, 2.06]])
    run = forces(size)
    names = ("tension:0.5", "tension:0,2", "tension:0.5,2", "tension:0.48,2.06", "tension:0.1")
    found = [*objectives.values(run, names).values()]
    np.testing.assert_allclose(found, [16.0, 9.0, 25.0, 0.0, 0.0], atol=1e-9)

    def cost(scale):
        rows = {"reaction_B": scale[..., None] * run["reaction_B"]}
        return objectives.tension(dataclasses.replace(run, observables=rows), 0.5, 2.0)

    # T d/dT of (100 (1 - T/0.5))^2 and of (100 (T/2 - 1))^2
    slope = jax.grad(cost)(jnp.ones((2, 2)))
    np.testing.assert_allclose(slope, [[-800.0 * 0.96, 0.0], [0.0, 600.0 * 1.03]], rtol=1e-9)
    # Twice the squares of the percents at a limit; members of a batch are on their own.
    curvature = jax.hessian(cost)(jnp.ones((2, 2))).reshape(4, 4)
    np.testing.assert_allclose(curvature, np.diag([2.0 * 96.0**2, 0.0, 0.0, 2.0 * 103.0**2]), atol=1e-9)
    both = jax.vmap(jax.grad(cost))(jnp.stack([jnp.ones((2, 2)), jnp.full((2, 2), 1.1)]))
    np.testing.assert_allclose(both[0], slope, rtol=1e-12)
    np.testing.assert_allclose(both[1], jax.grad(cost)(jnp.full((2, 2), 1.1)), rtol=1e-12)


def test_a_tether_without_tension_has_a_derivative_in_a_limit():
    """A released tether has no force at all; the root of its square would have no derivative."""
    run = forces([[1.0]])

    def cost(reaction):
        return objectives.tension(dataclasses.replace(run, observables={"reaction_B": reaction}), 0.5)

    value, slope = jax.value_and_grad(cost)(jnp.zeros((1, 1, 3)))
    assert abs(value - 1e4) < 1e-6
    assert np.isfinite(slope).all()


def test_a_limit_is_not_divided_by_its_value_at_constant_voltage(monkeypatch):
    """It is zero there, or not; what counts are the percents outside."""
    objective = Objective("baseline", {"tension:0.01": 2.0, "coning": 1.0})
    monkeypatch.setattr(objective, "reference_values", {"tension:0.01": 0.0, "coning": 4.0})
    assert objective.references == {"tension:0.01": 1.0, "coning": 4.0}
    several = Objective("baseline", objective.weights, {"solar_wind.speed": np.array([4e5, 5e5])})
    each = iter([{"tension:0.01": 0.0, "coning": 4.0}, {"tension:0.01": 9.0, "coning": 6.0}])
    monkeypatch.setattr(several, "simulate_reference", lambda circumstance: circumstance)
    monkeypatch.setattr(several, "measure", lambda run: next(each))
    for name, reference in (("tension:0.01", 1.0), ("coning", 5.0)):
        assert several.references[name].tolist() == [reference, reference]
    run = forces([[0.0098, 0.2]])
    assert abs(objectives.weighted_sum(run, {"tension:0.01": 2.0}, objective.references) - 8.0) < 1e-9


@pytest.mark.parametrize("weight", [np.nan, np.inf])
def test_a_weight_that_is_no_finite_number_is_refused(weight):
    with pytest.raises(esail.SceneError, match="`weights` must be finite numbers, but has "):
        Objective("baseline", {"thrust": weight})


@pytest.mark.nightly
@pytest.mark.parametrize("start", [10.0, -10.0, 0.0, 180.0])
def test_spin_plane_is_measured_from_its_target(start):
    """At the start of a run the spin plane is that of the hub, which gives the objective in closed form.

    The distance from another normal is the chord between two unit vectors, and zero from its own normal.
    Rounding of the tips is 1e-12 m in 10 km.
    """
    scene = {
        "tethers.count": 3, "tethers.elements": 2, "integrator.method": "generalized-alpha",
        "integrator.t_end": 1.0, "initial.sailing_angle_deg": start,
    }  # fmt: skip
    run = esail.simulate("baseline", scene)
    rows = {name: x[:1] for name, x in run.observables.items()}
    first = dataclasses.replace(run, observables=rows, time=run.time[:1])
    alpha, delta = np.deg2rad([13.0, 20.0])
    aim = np.array([np.sin(alpha) * np.cos(delta), np.sin(alpha) * np.sin(delta), np.cos(alpha)])
    own = np.array([np.sin(np.deg2rad(start)), 0.0, np.cos(np.deg2rad(start))])
    found = objectives.values(first, ("spin-plane:13,20", f"spin-plane:{start}", "spin-plane:0"))
    assert abs(found["spin-plane:13,20"] - ((aim - own) ** 2).sum()) < 1e-12
    assert found[f"spin-plane:{start}"] < 1e-24
    assert abs(found["spin-plane:0"] - (2.0 * np.sin(0.5 * np.deg2rad(start))) ** 2) < 1e-12
    with pytest.raises(esail.SceneError, match="at most the whole run, but asks for 9 s of a run of 1 s"):
        objectives.values(run, ("spin-plane:13,20,9",))


WINDS = {
    "solar_wind.speed": np.array([[3.8e5, 4.1e5, 4e5], [4.4e5, 4e5, 3.6e5]]),
    "tethers.length": np.array([[10e3, 10.05e3, 9.95e3], [9.9e3, 10e3, 10.1e3]]),
}
"""Two circumstances, each with a wind in time and with errors of the tether lengths."""

EACH = [{key: rows[i] for key, rows in WINDS.items()} for i in range(2)]

NAMES = (*objectives.NAMES, "spin-plane:13,20", "spin-plane:13,20,200", "tension:1", "tension:0,0.1")


@pytest.fixture(scope="module")
def measured(torque):
    """A function from coordinates and circumstance to all objectives of NAMES, and the same with its
    Jacobian as a compiled program."""

    def each(x, circumstance):
        run = esail.simulate(torque.scene, torque.parameters_at(x) | circumstance)
        found = objectives.values(run, NAMES)
        return jnp.stack([found[name] for name in NAMES])

    def with_jacobian(x, circumstance):
        value, back = jax.vjp(lambda x: each(x, circumstance), x)
        return value, jax.vmap(back)(jnp.eye(len(NAMES)))[0]

    return each, jit(with_jacobian)


@pytest.mark.nightly
def test_gradient_of_every_objective(measured, torque):
    """Gradients agree with central differences of concrete runs, relative to the largest derivative."""
    each, with_jacobian = measured
    x = np.array([0.5, -0.3])
    value, exact = with_jacobian(x, EACH[0])
    # Traced and concrete values agree; small objectives are differences of unit vectors.
    np.testing.assert_allclose(value, each(x, EACH[0]), rtol=1e-6, atol=1e-12)
    for i, along in enumerate(np.eye(2)):
        e = 1e-3
        ends = [np.asarray(each(x + step * along, EACH[0])) for step in (-2 * e, -e, e, 2 * e)]
        quotient = (8 * (ends[2] - ends[1]) - (ends[3] - ends[0])) / (12 * e)
        scale = np.abs(exact).max(1)
        assert (np.abs(quotient - exact[:, i]) < 1e-4 * scale).all(), (quotient, exact[:, i])


@pytest.mark.nightly
def test_objective_is_the_mean_over_circumstances(measured, torque):
    """The objective of two circumstances and its gradient are the means of those of the single
    circumstances.

    The torque is divided by its mean without modulation, the thrust by that in the same wind: the objective
    is the torque's part plus twice the square of the percentage of thrust that is missing to 96 %. It is
    put together here from the single objectives and their Jacobian, in another program: their rounding is
    raised to 1e-8 by the quotient of small torques.
    """
    design = Design(torque.scene, {"mean-torque": 1.0, "thrust": 2.0}, FREE, circumstances=WINDS)
    # The points: zero modulation, and another one.
    state = next(design.optimise(0, starts=2, seed=0, spread=0.5))
    x, value, slope = state.x[1], state.value[1], state.gradient[1]
    assert np.abs(x).min() > 0.05
    plain = [measured[0](jnp.zeros(2), circumstance) for circumstance in EACH]
    torques, thrust = NAMES.index("mean-torque"), NAMES.index("thrust")
    torque_of_plain = 0.5 * (plain[0][torques] + plain[1][torques])
    found = []
    for circumstance, before in zip(EACH, plain, strict=True):
        values, rows = measured[1](x, circumstance)
        missing = 100.0 * max(0.96 - values[thrust] / before[thrust], 0.0)
        change = -200.0 * missing * rows[thrust] / before[thrust]
        found.append((values[torques] / torque_of_plain + 2.0 * missing**2,
                      rows[torques] / torque_of_plain + 2.0 * change))  # fmt: skip
    assert abs(value / (0.5 * (found[0][0] + found[1][0])) - 1.0) < 1e-8
    assert np.allclose(slope, 0.5 * (found[0][1] + found[1][1]), rtol=1e-7, atol=0.0)
    assert abs(found[0][0] / found[1][0] - 1.0) > 1e-3
    # Without modulation the thrust term is zero in any wind, and the mean torque term is one.
    assert abs(state.value[0] - 1.0) < 1e-6


@pytest.mark.nightly
def test_several_starts_are_designs_of_their_own(torque, optimised):
    """Each of three starts reaches the same design as among copies of itself.

    Every start has its own search direction and step length and does not depend on the others. Rounding
    errors grow where the torque is nearly cancelled.
    """
    together = optimised
    assert len({float(value) for value in together[0].value}) == 3
    for i in range(3):
        three = np.array([i, i, i])
        copies = dataclasses.replace(
            together[0],
            x=together[0].x[three],
            value=together[0].value[three],
            gradient=together[0].gradient[three],
            memory=jax.tree.map(lambda leaf, three=three: leaf[three], together[0].memory),
        )
        states = [copies, *torque.optimise(2, copies)]
        for one, all in zip(states, together[:3], strict=True):
            assert np.allclose(one.x, all.x[i], rtol=1e-7, atol=1e-9)
            assert np.abs(one.value - all.value[i]).max() < 1e-9 * together[0].value[i]


@pytest.mark.nightly
def test_a_design_from_the_shell_goes_on_as_if_uninterrupted(tmp_path, capsys):
    """One iteration and then another give the same bits as two iterations.

    An existing design is not overwritten, and a different design is not resumed. The design has the scene
    and the number of starts of `torque`, and so its program.
    """
    settings = [x for k, v in SMALL.items() for x in ("--set", f"{k}={v}")]
    command = ["design", "baseline", *settings, "--starts", "3", "--quiet", "-o"]
    once, twice = tmp_path / "once", tmp_path / "twice"
    assert main([*command, str(once), "--iterations", "2"]) == 0
    assert main([*command, str(twice), "--iterations", "1"]) == 0
    assert main([*command, str(twice), "--iterations", "2", "--resume"]) == 0
    for name in ("designed.toml", "design.png", "before.h5", "after.h5"):
        assert (twice / name).exists()
    assert (once / "designed.toml").read_text() == (twice / "designed.toml").read_text()
    capsys.readouterr()
    assert main(["info", str(twice)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"{twice}: design, 2 iterations from each of 3 starts"
    value = read_history(twice / "design.h5")
    assert "mean-torque 1, thrust 1" in lines[1] and value[-1].min() < value[0].min()
    assert lines[2] == f"  objective  {value[0, 0]:.6g} at the start, {value[-1].min():.6g} now"
    assert lines[4].split() == ["run", str(twice / "before.h5"), str(twice / "after.h5")]
    assert main(["plot", str(twice), "-o", str(tmp_path / "figures")]) == 0
    assert "compare_tether.png" in capsys.readouterr().out
    assert main(["info", str(twice / "design.h5")]) == 2
    assert "is the history of a design: give its folder" in capsys.readouterr().err
    assert main([*command, str(once)]) == 2
    assert "must not exist" in capsys.readouterr().err
    assert main([*command, str(once), "--resume", "--objective", "spin=1"]) == 2
    assert "must be of the same weights" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--objective", "speed=1"], "`objective` must be one of mean-torque, "),
        (["--objective", "spin-plane=1"], "`objective` must look like spin-plane:15, spin-plane:15,0 (deg"),
        (["--objective", "spin-plane:1,2,3,4=1"], "`objective` must look like spin-plane:15"),
        (["--objective", "spin-plane:15,20,-1=1"], "`objective` must look like spin-plane:15"),
        (["--objective", "spin-plane:nan=1"], "`objective` must look like spin-plane:15"),
        (["--objective", "tension=1"], "`objective` must look like tension:0.01 (at least, N) or tension"),
        (["--objective", "tension:0=1"], "or tension:0.01,0.02 (at least and at most), but is 'tension:0'"),
        (["--objective", "tension:2,1=1"], "`objective` must look like tension:0.01 (at least, N) or "),
        (["--objective", "tension:-1,1=1"], "`objective` must look like tension:0.01 (at least, N) or "),
        (["--objective", "lagging:3=1"], "`objective` must be one of mean-torque, "),
        (["--objective", "spin"], "`--objective` must look like NAME=WEIGHT, but is 'spin'"),
        (["--iterations", "0"], "`--iterations` must be positive, but is 0"),
    ],
)
def test_bad_input(arguments, message, tmp_path, capsys):
    """Bad input is answered by one line, and nothing is written."""
    folder = tmp_path / "design"
    assert main(["design", "baseline", "-o", str(folder), *arguments]) == 2
    assert message in capsys.readouterr().err
    assert not folder.exists()


def test_help_lists_every_objective(capsys):
    with pytest.raises(SystemExit):
        main(["design", "--help"])
    text = "".join(capsys.readouterr().out.split())
    for name in (*objectives.NAMES, *objectives.PARAMETRISED):
        assert name in text, name
