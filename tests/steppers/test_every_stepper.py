"""Every stepper, the package's and one from outside, in all that a run offers.

CASES is a table with one entry per method. A new method becomes one more entry, and then passes through
order of convergence, output between steps, resuming, events, derivatives, batches and failures. Every case
compiles three programs: the run on the host, a batch of traced runs, and a run with its derivatives."""

import dataclasses
import functools
import re
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
from esail_jax.ensembles.member_runner import MemberRunner
from esail_jax.ensembles.members import simulate_members
from esail_jax.rod_chain import error_scale
from esail_jax.scenes.build import build_chain
from esail_jax.scenes.loading import parse
from esail_jax.scenes.scene import Scene
from esail_jax.scenes.structure import split
from esail_jax.simulation.advance import Window, advance, move
from esail_jax.simulation.host import HostRun, compile_scene
from esail_jax.simulation.problem import start
from esail_jax.simulation.restoring import paths
from esail_jax.simulation.results import join
from esail_jax.steppers.collocation import Collocation
from esail_jax.steppers.energy_momentum import EnergyMomentum
from esail_jax.steppers.generalized_alpha import GeneralizedAlpha
from esail_jax.steppers.results import name_of
from esail_jax.steppers.runge_kutta import RungeKutta
from esail_jax.steppers.stepper import AbstractStepper, Motion, Point
from esail_jax.system import Power
from support.own_stepper import RungeKutta4
from support.quick import jit

pytestmark = pytest.mark.nightly

SAIL = """
[tethers]
count = 2
length = 1000.0
area = 4.28e-9
density = 7653.0
youngs_modulus = 5e7
elements = 1
axial_damping_time = [0.3, 0.4]

[remote_units]
mass = 0.5

[solar_wind]
speed = 4e5
number_density = 7.3e6
cutoff_voltage = 1e3

[voltage]
value = [2e6, 1e6]

[initial]
spin_rate = 0.01
sailing_angle_deg = 60.0
coning_angle_deg = 5.0

[integrator]
t_end = 16.0

[output]
interval = 1.0

[[event]]
time = 9.3
release = 2
"""
"""Two soft tethers on a turning frame. With EA = 0.2 N the fastest modes stay near 1 rad/s, so that every
method resolves them. The second tether is released within a step."""

HUB = """
[hub]
height = 2.0
radius = 1.0
density = 884.0
"""

CHAIN = """
[chain]
rods = 2
mass = 0.1
length = 1.0
area = 1e-6
youngs_modulus = 1e7
axial_damping_time = 1e-3

[gravity]
acceleration = [0.0, -9.81, 0.0]

[initial]
rod_vector = [0.0, -1.0, 0.0]
rod_rate = [1.0, 0.0, 0.0]

[integrator]
t_end = 1.6

[output]
interval = 0.1
"""

VELOCITY = r"(^|/)v(/|$)"
"""Matches the paths of velocities in a start."""

LATE = {"event.time": [100.0]}
"""Override that moves the release behind the end of the run. It leaves the programs as they are."""


@dataclasses.dataclass(frozen=True)
class Case:
    """A method on a scene.

    scene; stepper: the method with a fineness, which is a step size [s] or a tolerance; fineness: three of
    them; order: the order of convergence and how far it may be missed (None where errors are rounding);
    between: the largest error between steps, relative to the largest at their ends; max_steps: a bound
    that the coarsest run keeps and the finest does not; failures: results by input, a factor of the first
    number or a fineness."""

    scene: Scene
    stepper: Callable[[Any], AbstractStepper]
    fineness: tuple[float, float, float]
    order: tuple[float, float] | None
    max_steps: int
    failures: Mapping[tuple[str, float], str]
    between: float = 3.0

    @property
    def chain(self) -> bool:
        return self.scene.chain is not None

    @property
    def end(self) -> float:
        return self.scene.integrator.t_end

    @property
    def names(self) -> tuple[str, ...]:
        """Observables that are compared."""
        if self.chain:
            return ("joint_position", "dissipated_energy", "tension")
        return ("tip_position_I", "dissipated_energy", "external_work", "reaction_B")

    @property
    def hub(self) -> tuple[str, ...]:
        """The observable of the hub's motion, if there is a hub."""
        return ("hub_position_I",) * (self.scene.hub is not None)

    @property
    def saved(self) -> tuple[str, ...]:
        """Observables that the runs save."""
        return (*self.names, *self.hub)

    def numbers(self, x: Any) -> dict[str, Any]:
        """Overrides of four numbers of the scene; x: factors."""
        if self.chain:
            return {
                "initial.rod_rate": np.array([1.0, 0.0, 0.2]) * x[0],
                "chain.mass": 0.1 * x[1],
                "chain.axial_damping_time": 1e-3 * x[2],
                "chain.youngs_modulus": 1e7 * x[3],
            }
        return {
            "voltage.value": np.array([2e6, 1e6]) * x[0],
            "initial.spin_rate": 0.01 * x[1],
            "remote_units.mass": 0.5 * x[2],
            "tethers.youngs_modulus": 5e7 * x[3],
        }

    def run(self, fineness: Any, x: Any = (1.0,) * 4, times: Any = None, late: bool = False, **more: Any):
        """The run with this fineness and these factors, with a release unless it is to be late."""
        overrides = self.numbers(x) | (LATE if late and not self.chain else {})
        stepper = self.stepper(jnp.asarray(fineness, float))
        times = None if times is None else [float(time) for time in times]
        return esail.simulate(self.scene, overrides, stepper=stepper, save=self.saved, times=times, **more)


FRAME, SMALL_SAIL, SMALL_CHAIN = parse(SAIL, "frame"), parse(HUB + SAIL, "sail"), parse(CHAIN, "chain")
NONFINITE = {("number", np.inf): "nonfinite", ("number", 1e200): "nonfinite"}
"""Results where a number overflows. The strain of positions of 1e200 m is infinite. So is that of a
diverging iteration with steps of 1e4 s: its positions grow with the third power, to 3^12 digits."""

DIVERGED = {("number", np.inf): "nonfinite", ("number", 1e200): "newton_diverged"}
"""Results of a method whose iterations end before they overflow, once they grow."""


@functools.cache
def chain_scale() -> Any:
    """Magnitudes of the chain's coordinates, by which an error control measures. The first call may be in a
    traced function, and the result is kept."""
    with jax.ensure_compile_time_eval():
        return error_scale(*build_chain(*split(SMALL_CHAIN)))


CASES = {
    "own": Case(FRAME, RungeKutta4, (0.4, 0.2, 0.1), (4.0, 0.3), 100, NONFINITE),
    "tsit5": Case(
        SMALL_CHAIN,
        lambda h: RungeKutta(h, None, None, "tsit5"),
        (4e-3, 2e-3, 1e-3),
        (5.0, 0.3),
        500,
        NONFINITE,
    ),
    "dopri8": Case(
        SMALL_CHAIN,
        lambda tolerance: RungeKutta(None, tolerance, chain_scale(), "dopri8"),
        (1e-5, 1e-7, 1e-9),
        (8.0, 2.0),
        50,
        {},
    ),
    "collocation": Case(
        SMALL_SAIL,
        lambda tolerance: Collocation(None, tolerance),
        (1e-5, 1e-7, 1e-9),
        (7.0, 1.5),
        12,
        # A force of 1e200 V asks for steps of 1e-99 s: the run ends at any number of steps.
        {("number", np.inf): "nonfinite"},
    ),
    "collocation-fixed": Case(
        FRAME,
        lambda h: Collocation(h, jnp.asarray(1e-8)),
        (1.0, 0.5, 0.25),
        None,
        24,
        DIVERGED | {("fineness", 1e4): "newton_diverged"},
    ),
    "generalized-alpha": Case(
        SMALL_SAIL,
        lambda h: GeneralizedAlpha(h, jnp.asarray(0.8)),
        (0.2, 0.1, 0.05),
        (2.0, 0.1),
        200,
        NONFINITE | {("fineness", 1e4): "nonfinite"},
    ),
    "energy-momentum": Case(SMALL_SAIL, EnergyMomentum, (0.2, 0.1, 0.05), (2.0, 0.1), 200, NONFINITE),
}


every_case = pytest.mark.parametrize("name", CASES)


def difference(one: Any, other: Any, name: str, rows: Any = slice(None)) -> float:
    """The largest difference of an observable between two runs, relative to its largest magnitude."""
    a, b = np.asarray(one[name])[rows], np.asarray(other[name])[rows]
    return float(np.abs(a - b).max() / np.abs(np.asarray(other[name])).max())


# ---- steps --------------------------------------------------------------------------------------


@every_case
def test_order_of_convergence_at_steps_and_between_them(name):
    """Differences between three runs fall with the order of the method, by the number of steps.

    Instants between two steps, where dense output is used, are as accurate as the end, within a factor.
    The tethers are not released: after an event the steps depend on the output."""
    case = CASES[name]
    times = case.end * np.array([0.5, 0.5137, 0.731, 1.0])
    coarse, middle, fine = (case.run(f, times=times, late=True) for f in case.fineness)
    position = case.names[0]
    first, second = difference(coarse, middle, position), difference(middle, fine, position)
    if case.order is None:
        assert max(first, second) < 1e-13
        return
    expected, missed_by = case.order
    order = np.log(first / second) / np.log(middle.steps / coarse.steps)
    assert abs(order - expected) < missed_by, order
    for one, other in ((coarse, middle), (middle, fine)):
        ends = [difference(one, other, position, row) for row in ([0], [3])]
        between = [difference(one, other, position, row) for row in ([1], [2])]
        assert max(between) < case.between * max(ends)


@pytest.mark.parametrize("name", CASES)
def test_saved_instants_do_not_change_the_steps(name):
    """Runs with many and with few saved instants take the same steps, and agree in every bit where both
    save."""
    case = CASES[name]
    few = case.end * np.array([0.31, 1.0])
    many = np.union1d(np.linspace(0.0, case.end, 23), few)
    one, other = (case.run(case.fineness[0], times=times, late=True) for times in (few, many))
    assert one.steps == other.steps
    for key in case.names:
        assert np.array_equal(one[key], other[key][np.searchsorted(many, few)]), key


@pytest.mark.parametrize("name", CASES)
def test_a_run_goes_on_after_any_batch_of_blocks(name):
    """A run that stops after every batch of blocks, and goes on from arrays by path, has the same bits as
    one that never stops. So has a run that is continued from the end of a shorter one."""
    case = CASES[name]
    stepper = case.stepper(jnp.asarray(case.fineness[1], float))
    compiled = compile_scene(case.scene, stepper, None, None if case.chain else case.saved)
    whole = HostRun(compiled)
    expected = rows_of(whole.chunks())

    programs = compiled.programs._replace(batches=1)
    run, chunks = HostRun(compiled._replace(programs=programs)), []
    while run.checkpoint.rows < len(run.times):
        chunks.append(next(run.chunks()))
        motion, carried = (
            {path: np.array(x) for path, x in paths(part).items()}
            for part in (run.checkpoint.motion, run.checkpoint.carried)
        )
        run = HostRun(run.compiled, run.checkpoint._replace(motion=motion, carried=carried))
    assert len(chunks) > 1
    check_bits(rows_of(chunks), expected)

    # The shorter run ends between two saved instants of the longer one.
    short = case.scene.replace({"integrator.t_end": 0.73 * case.end})
    first = HostRun(compile_scene(short, stepper, None, None if case.chain else case.saved))
    begun = rows_of(first.chunks())
    kept = first.checkpoint.rows
    rest = rows_of(HostRun(compiled, first.checkpoint).chunks())
    check_bits({key: np.concatenate([begun[key][:kept], rest[key]]) for key in begun}, expected)


def rows_of(chunks: Any) -> dict[str, np.ndarray]:
    """Time, observables and statistics of several chunks."""
    return join([{"time": x.time, **x.observables, **x.numerics} for x in chunks])


def check_bits(found: Mapping[str, np.ndarray], expected: Mapping[str, np.ndarray]) -> None:
    """The arrays are the same, bit by bit."""
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        assert np.array_equal(found[name], values, equal_nan=True), name


# ---- one window ---------------------------------------------------------------------------------


def scaled(tree: Any, pattern: str, factor: Any) -> Any:
    """The tree with the numbers whose path matches a pattern multiplied by a factor."""

    def one(path, x):
        name = "/".join(str(getattr(key, "name", getattr(key, "idx", key))) for key in path)
        return factor * x if re.search(pattern, name) else x

    return jax.tree_util.tree_map_with_path(one, tree)


@every_case
def test_contract_of_a_window(name):
    """What a method owes its drivers, on the first window of a run, without scan and observables.

    The replay of the recorded blocks gives the motion that the blocks gave, to rounding: that of the tips,
    which move a thousand times faster than the hub that they pull at, is seen in its motion. Forward mode,
    by stiffness and initial velocity, agrees with the difference quotient of windows (1e-6), reverse with
    forward mode (1e-10, rounding). With error control other numbers have other steps and so another error
    of the dense output: there wider differences of the positions are compared, to 1e-4. In a batch with a
    member that overflows, that member ends without success and with NaN, and the others are the windows
    alone."""
    case = CASES[name]
    has_error_control = name in ("collocation", "dopri8")
    stepper = case.stepper(jnp.asarray(1e-12 if has_error_control else case.fineness[2], float))
    begun = jit(start, static_argnums=0)(*split(case.scene), stepper)
    count = min(2, stepper.instants_per_window)
    window = Window(case.end * jnp.array([0.2137, 0.23])[:count], jnp.asarray(count))
    limit = jnp.asarray(jnp.inf)

    zero, until, now = jnp.zeros(()), jnp.asarray(jnp.inf), begun.motion.state.now
    begin = now.y if case.chain else Point(zero, now.q, now.v, Power(zero, zero), jnp.asarray(True))

    def inputs(x):
        problem = scaled(begun.problem, "stiffness$", x[0])
        state, last = stepper.init(problem.model, scaled(begin, VELOCITY, x[1]), until)
        return problem, Motion(state, last, jnp.zeros(2))

    def signal(x):
        motion, points, passed = move(*inputs(x), window, limit)
        q, v = (jnp.concatenate([jnp.ravel(y) for y in jax.tree.leaves(z)]) for z in (points.q, points.v))
        return jnp.concatenate([q / jnp.abs(q).max(), v / jnp.abs(v).max()]), (motion.state.result, passed)

    along = jnp.array([1.0, -0.3])

    @jit
    def alone(x, weights):
        value, forward, ended = jax.jvp(signal, (x,), (along,), has_aux=True)
        reverse = jax.vjp(lambda x: signal(x)[0], x)[1](weights)[0]
        problem, motion = inputs(x)
        room = stepper.blocks_per_window
        found = advance(problem, motion, window, limit, jnp.asarray(room), stepper.tape, room)
        _, points = stepper.replay(
            problem.model, motion, found.motion, found.kept, found.batches, window.times
        )
        return value, forward, ended, reverse, (found.points.q, found.points.v), (points.q, points.v)

    one = jnp.ones(2)
    weights = jnp.asarray(np.random.default_rng(1).normal(size=jax.eval_shape(signal, one)[0].shape))
    value, forward, (result, passed), reverse, taken, replayed = alone(one, weights)
    assert name_of(result) == "successful" and passed == count
    for part in zip(taken, replayed, strict=True):
        leaves = jax.tree.map(np.asarray, tuple(map(jax.tree.leaves, part)))
        rounding = 1e-13 * max(np.abs(a).max(initial=0.0) for a in leaves[0])
        for a, b in zip(*leaves, strict=True):
            np.testing.assert_allclose(b, a, rtol=0, atol=1e-11 * np.abs(a).max(initial=0.0) + rounding)
    assert abs(reverse @ along / (weights @ forward) - 1.0) < 1e-10

    @jit
    def batch(factors):
        return jax.vmap(signal)(factors)

    e, steps = 1e-2 if has_error_control else 1e-3, jnp.array([-2.0, -1.0, 1.0, 2.0])
    near = one + e * steps[:, None] * along
    values, (results, _) = batch(jnp.concatenate([jnp.array([[1.0, 1.0], [1e300, 1e300]]), near]))
    np.testing.assert_allclose(values[0], value, rtol=0, atol=1e-11)
    ended = [name_of(jax.tree.map(lambda x, k=k: x[k], results)) for k in range(len(values))]
    assert ended[1] != "successful" and {*ended[:1], *ended[2:]} == {"successful"}
    assert np.isnan(values[1]).any()

    quotient = (values[2] - 8.0 * values[3] + 8.0 * values[4] - values[5]) / (12.0 * e)
    compared = slice(len(quotient) // 2 if has_error_control else None)
    gap, bound = np.abs(forward - quotient)[compared].max(), 1e-4 if has_error_control else 1e-6
    assert gap < bound * np.abs(quotient[compared]).max()


# ---- traced runs --------------------------------------------------------------------------------


@every_case
def test_batch_of_traced_runs_equals_a_loop_on_the_host(name):
    """One `vmap` holds good members, members that fail, and one that needs too many steps.

    Every member ends with the same member of RESULTS and the same numbers of steps as its run on the host.
    Its observables agree to 1e-9 of their largest value (rounding, through the release of a tether), and
    are NaN at the same instants. The release makes a difference."""
    case = CASES[name]
    times = case.end * np.array([0.25, 0.5137, 1.0])
    coarse, _, fine = case.fineness
    inputs = [(coarse, 1.0, "successful"), (coarse, 1.01, "successful"), (fine, 1.0, "too_many_steps")]
    for (what, value), result in case.failures.items():
        inputs.append((value, 1.0, result) if what == "fineness" else (coarse, value, result))
    finenesses, factors, _ = zip(*inputs, strict=True)

    def member(fineness, factor):
        run = case.run(fineness, (factor, 1.0, 1.0, 1.0), times, max_steps=case.max_steps)
        return dict(run), run.result, run.steps, run.stats["rejected_steps"]

    batch = jit(jax.vmap(member))(jnp.array(finenesses), jnp.array(factors))
    for k, (fineness, factor, result) in enumerate(inputs):
        rows, ended, steps, rejected = jax.tree.map(lambda x, k=k: x[k], batch)
        assert name_of(ended) == result
        numbers = (factor, 1.0, 1.0, 1.0)
        if not np.isfinite(factor):  # the host refuses such a number before it runs
            with np.errstate(invalid="ignore"), pytest.raises(esail.SceneError):  # 0 times infinity
                case.run(fineness, numbers, times)
            continue
        host = case.run(fineness, numbers, times, max_steps=case.max_steps, throw=False)
        assert name_of(host.result) == result
        assert (int(steps), int(rejected)) == (host.steps, host.stats["rejected_steps"])
        for key in case.names:
            size = np.nanmax(np.abs(host[key]), initial=0.0)
            np.testing.assert_allclose(rows[key], host[key], rtol=0, atol=1e-9 * size, err_msg=key)
    if not case.chain:
        held = case.run(coarse, times=times, late=True)
        before, after = (difference(case.run(coarse, times=times), held, "reaction_B", [k]) for k in (1, 2))
        assert before < 1e-9 and after > 1e-3


@every_case
def test_derivative(name):
    """Forward mode agrees with the difference quotient of host runs to 1e-6, and reverse with forward mode
    to 1e-10 (rounding). The derivative goes through the release of a tether.

    Runs with error control choose other steps for other numbers, so that their quotient has the error of
    the tolerance over the difference of the numbers. With the finest tolerance this is 3e-7. The hub, if
    there is one, moves by a thousandth of what the tips do; its bound is 1e-4."""
    case = CASES[name]
    times = case.end * np.array([0.25, 0.5137, 1.0])
    fineness = case.fineness[2]
    along, one = np.array([0.3, 1.0, -0.2, 0.5]), np.ones(4)
    signalled = (*case.names[:2], *case.hub)
    before = case.run(fineness, one, times)
    sizes = {key: np.abs(before[key]).max() for key in case.names} | dict.fromkeys(case.hub, 1e3)

    def signals(x):
        run = case.run(fineness, x, times)
        return jnp.concatenate([jnp.ravel(run[key]) / sizes[key] for key in signalled])

    @jit
    def derivatives(x, weights):
        value, forward = jax.jvp(signals, (x,), (jnp.asarray(along),))
        return value, forward, jax.vjp(signals, x)[1](weights)[0]

    host = np.asarray(signals(one))
    weights = np.random.default_rng(1).normal(size=host.size)
    value, forward, reverse = derivatives(jnp.asarray(one), jnp.asarray(weights))
    np.testing.assert_allclose(value, host, rtol=0, atol=1e-9)
    assert abs(reverse @ along / (weights @ forward) - 1.0) < 1e-10

    e = 1e-3
    near, far = ((signals(one + k * e * along) - signals(one - k * e * along)) for k in (1, 2))
    quotient = np.asarray(8.0 * near - far) / (12.0 * e)
    ends = np.cumsum([np.size(before[key]) for key in signalled])[:-1]
    for key, got, wanted in zip(signalled, *(np.split(x, ends) for x in (forward, quotient)), strict=True):
        bound = 1e-4 if key in case.hub else 1e-6
        assert np.abs(got - wanted).max() < bound * np.abs(wanted).max(), key


# ---- runs that a shorter step saves ---------------------------------------------------------------


SPUN = {
    "tethers.count": 3,
    "tethers.elements": 2,
    "integrator.method": "generalized-alpha",
    "integrator.step": 80.0,
    "integrator.t_end": 4000.0,
    "output.interval": 400.0,
}
"""Overrides of the baseline with steps of a third of a radian of spin, some of which do not converge until
they are halved."""

TIPS = "tip_position_I"


@functools.cache
def repaired() -> esail.Solution:
    """The run on the host, some steps of which were rejected."""
    found = esail.simulate("baseline", SPUN)
    assert found.stats["rejected_steps"] > 0 and name_of(found.result) == "successful"
    return found


def test_a_traced_run_halves_steps_that_do_not_converge():
    """A run inside a function of no arguments, under plain `jax.jit`, gives the run on the host and halves
    the same steps."""
    host = repaired()

    def run():
        found = esail.simulate("baseline", SPUN)
        return found[TIPS], found.result, found.steps, found.stats["rejected_steps"]

    tips, result, steps, rejected = jax.jit(run)()
    assert name_of(result) == "successful"
    assert (int(steps), int(rejected)) == (host.steps, host.stats["rejected_steps"])
    # Rounding grows over 16 radians of spin with steps that hardly converge.
    np.testing.assert_allclose(tips, host[TIPS], rtol=0, atol=1e-9 * np.abs(host[TIPS]).max())


@pytest.mark.parametrize("lockstep", [False, True])
def test_a_member_that_halves_steps_is_not_run_alone(lockstep, monkeypatch):
    """All members of an ensemble complete in the batch, and equal single runs on the host."""
    monkeypatch.setattr(MemberRunner, "run_alone", lambda *_: pytest.fail("a member was run alone"))
    inputs = {"voltage.value": np.array([20e3, 10e3])[:, None] * np.ones(3)}
    scene = esail.load_scene("baseline", SPUN)
    found = simulate_members(scene, inputs, [TIPS], lockstep=lockstep)
    assert found.complete.all()
    tips, host = np.asarray(found.observables[TIPS][0]), repaired()[TIPS]
    np.testing.assert_allclose(tips, host, rtol=0, atol=1e-9 * np.abs(host).max())


def test_a_users_vmap_of_runs_that_halve_steps():
    """Plain `jax.vmap` and `jax.jit`, without options of this package."""
    volts = jnp.array([20e3, 10e3])

    def run(volt):
        found = esail.simulate("baseline", SPUN | {"voltage.value": volt})
        return found[TIPS], found.stats["rejected_steps"]

    tips, rejected = jax.jit(jax.vmap(run))(volts)
    host = repaired()
    assert int(rejected[0]) == host.stats["rejected_steps"]
    np.testing.assert_allclose(tips[0], host[TIPS], rtol=0, atol=1e-9 * np.abs(host[TIPS]).max())


def test_reverse_gradient_of_a_run_of_many_steps():
    """The gradient of a run of 5,300 collocation steps agrees with the difference quotient of host runs."""
    case = CASES["collocation-fixed"]

    def height(x):
        return case.run(0.003, (1.0, x, 1.0, 1.0), [case.end])[TIPS][-1, 0, 2]

    slope = jit(jax.grad(height))(1.0)
    e = 1e-3
    near, far = (float(height(1.0 + k * e) - height(1.0 - k * e)) for k in (1, 2))
    quotient = (8.0 * near - far) / (12.0 * e)
    assert abs(slope / quotient - 1.0) < 1e-6
