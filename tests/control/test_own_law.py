"""Voltage laws that users write: at every state, and by sample and hold with a memory.

The laws and the sail are those of `support/own_laws.py`. All runs of a sampled law share its programs.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import esail_jax as esail
import support.own_laws
from esail_jax.cli import main
from esail_jax.control import Delayed, Noisy
from esail_jax.loads.law_structure import divided, identity_of
from esail_jax.scenes.loading import load_scene, parse
from esail_jax.scenes.structure import split
from esail_jax.scenes.toml_text import to_toml
from esail_jax.sensors import with_motion
from esail_jax.simulation.sampling import Control, hint_at_law
from esail_jax.simulation.schedule import sampling_instants, switch_times
from support.own_laws import PERIOD, SAIL, Clock, Swinging, Waves
from support.quick import build_jitted, jit

FIXED = {"integrator.method": "generalized-alpha", "integrator.step": 0.1}
SHORT = FIXED | {"integrator.t_end": 60.0}
"""A run with one sample after the start, by a method that compiles quickly."""

METHODS = {
    "generalized-alpha": FIXED,
    "collocation": {},
    "energy-momentum": FIXED | {"integrator.method": "energy-momentum"},
}


def simulate(law, overrides=None, **options):
    return esail.simulate("baseline", SAIL | (overrides or {}), voltage_law=law, **options)


# ---- values -------------------------------------------------------------------------------------


@pytest.mark.nightly
def test_a_law_of_the_package_written_again_gives_the_same_motion():
    """The law "harmonic" and the same formula as a user's law differ by rounding. Its position in the
    compiled program is another, so that sums may be rounded in another order: 1e-12 of the range."""
    mine = simulate(Waves())
    theirs = esail.simulate("baseline", SAIL | {"voltage.law": "harmonic", "voltage.cosine": [0.1]})
    for name in ("voltage", "tip_position_I", "angular_velocity_B", "thrust_O"):
        assert np.abs(mine[name] - theirs[name]).max() <= 1e-11 * np.ptp(theirs[name]), name


@pytest.mark.nightly
@pytest.mark.parametrize("method", METHODS)
def test_a_sampled_law_is_a_sequence_of_runs_with_constant_voltages(method):
    """Between two samples the voltage is constant. Runs with these constant voltages, each from the end of
    the one before, give the same tips (1e-9 of their range: the first step of a run and the projection of
    its start on the constraints are rounded differently)."""
    whole = simulate(Swinging(), METHODS[method])
    parts, start = [], None
    for first, last in ((0.0, 35.0), (35.0, 70.0), (70.0, 105.0), (105.0, 120.0)):
        times = [t for t in whole.time if first < t <= last] + [last] * (last not in whole.time)
        row = int(np.argmax(whole.time > first))
        scene = SAIL | METHODS[method] | {"voltage.value": whole["voltage"][row].tolist()}
        run = esail.simulate("baseline", scene, times=times, start=start, save=["tip_position_I"])
        start = run.final_state
        parts += [run["tip_position_I"][i] for i, t in enumerate(times) if t in whole.time]
    tips = whole["tip_position_I"]
    assert np.abs(np.stack(parts) - tips[1:]).max() <= 1e-9 * np.ptp(tips)
    # The law does change the voltages from sample to sample, and has seen the start and three samples.
    assert len(np.unique(whole["voltage"][:, 0])) == 4
    assert int(whole.checkpoint.control.memory["count"]) == 4


@pytest.mark.nightly
def test_samples_are_taken_at_multiples_of_the_period():
    """V = 20 kV + 10 V/s i t at t = 0, 35, 70, 105 s. A row at a sampling instant has the voltage before
    the sample."""
    # The end of the run is that of `times`, after the scene's own.
    end = {"integrator.t_end": 20.0}
    run = simulate(Clock(), end, times=[0.0, 34.0, 35.0, 36.0, 70.0, 71.0, 120.0], save=["voltage"])
    sampled = np.array([0.0, 0.0, 0.0, 35.0, 35.0, 70.0, 105.0])
    assert np.allclose(run["voltage"], 20e3 + 10.0 * np.outer(sampled, [1, 2, 3]), rtol=1e-15)


@pytest.mark.nightly
def test_limits_hold_for_every_law():
    """Upper limit, slew rate from sample to sample, and zero as lower limit."""
    limited = {"voltage.maximum": 40e3, "voltage.slew_rate": 300.0}
    run = simulate(Clock(800.0), limited, save=["voltage"])
    volts = run["voltage"]
    assert volts.max() <= 40e3 and volts.min() >= 0.0
    assert np.abs(np.diff(volts, axis=0)).max() == pytest.approx(300.0 * PERIOD, rel=1e-12)
    down = simulate(Clock(-800.0), limited | {"voltage.slew_rate": 1e6}, save=["voltage"])["voltage"]
    assert down[-1, 2] == 0.0


@pytest.mark.nightly
def test_the_power_limit_holds_for_a_sampled_law():
    """The voltages are scaled down together at every instant, not only at samples."""
    wires = {"tethers.wire_radius": 12.5e-6, "tethers.wires": 4, "voltage.power_limit": 4.0}
    run = simulate(Clock(50.0), wires, save=["voltage", "electric_power"])
    assert run["electric_power"] == pytest.approx(np.full(13, 4.0), rel=1e-12)
    ratio = run["voltage"][-1] / run["voltage"][-1, 0]
    free = 20e3 + 50.0 * 105.0 * np.array([1.0, 2.0, 3.0])
    assert np.allclose(ratio, free / free[0], rtol=1e-12)


def test_sampling_instants_divide_the_run():
    """They are multiples of the period, and replace switch times that differ from them by rounding."""
    scene = load_scene("baseline", SAIL | {"voltage_law": Clock(period=0.1), "integrator.t_end": 0.7})
    assert sampling_instants(scene) == tuple(0.1 * np.arange(1, 8))
    assert sampling_instants(scene, 0.35) == tuple(0.1 * np.arange(1, 4))
    with pytest.raises(esail.SceneError, match="must leave at most 1e\\+06 samples, but is 1e-07"):
        sampling_instants(scene.replace({"voltage_law": Clock(period=1e-7)}))
    event = scene.replace({"event.time": [0.3], "event.release": [1]})  # 3 * 0.1 is larger by rounding
    assert switch_times(event) == sampling_instants(scene)
    assert switch_times(scene.replace({"event.time": [0.35], "event.release": [1]}))[3] == 0.35


# ---- measurements -------------------------------------------------------------------------------


@pytest.mark.nightly
def test_measurements_are_those_of_the_run():
    """Tip positions in B, their rates, the angular velocity and the tension at the root of a moving sail.

    The rate is compared with central differences over 0.02 s (1e-6 of the largest rate: the fastest motion
    here has 0.5 s and an amplitude of 1e-8 of the length). The tension is the mean centrifugal force of the
    unit and of the tether beyond a point of the element, to 3e-3 (coning, vibration and hub)."""
    times = [100.0 - 0.01, 100.0, 100.0 + 0.01]
    run = simulate(Waves(), times=times)
    scene = load_scene("baseline", SAIL)
    structure, numbers = split(scene)
    system = build_jitted(structure, numbers).system
    at = simulate(Waves(), times=[100.0], save=[]).final_state
    found = with_motion(system, at.time, at.q, at.v, system.directions(at.time, at.q, at.v))

    hub, tips = run["hub_position_I"], run["tip_position_I"]
    body = np.einsum("tib,tki->tbk", run["rotation_IB"], tips - hub[:, None])
    assert np.allclose(found.rotation, run["rotation_IB"][1], atol=1e-13)
    assert np.allclose(found.angular_velocity, run["angular_velocity_B"][1], rtol=0, atol=1e-13)
    assert np.allclose(found.tip_position, body[1], rtol=0, atol=1e-7)
    rate = (body[2] - body[0]) / 0.02
    assert np.abs(found.tip_velocity - rate).max() <= 1e-6 * np.abs(rate).max() + 1e-6
    table, spin = scene.tethers, float(run["angular_velocity_B"][1, 0])
    line = table.density * table.area * table.length
    pull = (1.5 + line / 3.0) * table.length * spin**2
    assert np.allclose(found.root_tension, pull, rtol=3e-3)


# ---- derivatives and batches --------------------------------------------------------------------

NAMES = ("sailing_angle", "voltage", "tip_position_I")


def outcome(numbers, seed=3):
    """Angle, voltage and tip at the end of a run whose law sees noise and answers a sample too late.

    numbers: both gains, and the spread of the attitude's noise [rad]."""
    gain, rate, spread = numbers
    noisy = Noisy(Swinging(gain, rate), {"rotation": spread, "root_tension": 0.01}, seed)
    run = simulate(Delayed(noisy, 1), save=NAMES)
    return jnp.stack(
        [run["sailing_angle"][-1], run["voltage"][-1, 0] / 20e3, run["tip_position_I"][-1, 1, 2]]
    )


@pytest.mark.nightly
def test_derivatives_by_the_numbers_of_a_law_and_a_batch_of_seeds(validate):
    """Forward mode by the gains and the spread of the noise agrees with the fourth-order difference
    quotient of concrete runs (1e-6, the errors of the steps are 1e-9), and reverse mode with forward mode
    (1e-10). A batch of seeds equals single runs, which are repeated by their seeds."""
    numbers, along = np.array([0.1, 0.05, 1e-2]), np.array([0.7, -1.0, 0.1])
    value, forward = jit(lambda x: jax.jvp(outcome, (x,), (along,)))(numbers)
    concrete = {seed: np.asarray(outcome(numbers.tolist(), seed)) for seed in (3, 4)}
    assert np.array_equal(outcome(numbers.tolist()), concrete[3])
    assert (concrete[3] != concrete[4]).all()
    assert np.allclose(value, concrete[3], rtol=1e-9)

    def at(e):
        return np.asarray(outcome((numbers + e * along).tolist()))

    e = 2e-2
    quotient = (8.0 * (at(e) - at(-e)) - (at(2 * e) - at(-2 * e))) / (12.0 * e)
    error = np.abs(forward / quotient - 1.0).max()
    validate(
        "LAW-1", "sampled voltage law with memory, noise and delay", "difference quotient, fourth order",
        "angle, voltage and tip by gains and spread", error, 1e-6,
    )  # fmt: skip
    weights = np.array([1.0, 1.0, 1e-4])
    slopes = jax.value_and_grad(lambda x, seed: weights @ outcome(x, seed))
    values, reverse = jit(jax.vmap(slopes, (None, 0)))(numbers, jnp.array([3, 4]))
    assert abs(reverse[0] @ along / (weights @ forward) - 1.0) < 1e-10
    assert np.allclose(values, [weights @ concrete[seed] for seed in (3, 4)], rtol=1e-11)


@pytest.mark.nightly
def test_a_network_is_trained_in_a_design_objective():
    """`Objective` takes a law under the key `voltage_law`, here an `equinox` network, and a function of a
    solution among its weights: the value is that of the function, over its value at constant voltage.
    Along the gradient its central difference is the square of the gradient's norm times the step (1e-4),
    and a step against the gradient lowers it."""
    from esail_jax.design import Objective

    net = eqx.nn.MLP(2, "scalar", 4, 1, key=jax.random.key(0))

    class Policy(eqx.Module):
        net: eqx.nn.MLP
        period: float = eqx.field(static=True, default=PERIOD)

        def commanded(self, measurements):
            return 20e3 * (1.0 + 0.2 * jnp.tanh(jax.vmap(self.net, 1)(measurements.root_phase)))

    def last_angle(run):
        return run["sailing_angle"][-1]

    objective = Objective(load_scene("baseline", SAIL | SHORT), {last_angle: 2.0})
    numbers, others = eqx.partition(Policy(net), eqx.is_array)

    def cost(numbers):
        return objective({"voltage_law": eqx.combine(numbers, others)})

    value, slope = jit(jax.value_and_grad(cost))(numbers)
    constant = last_angle(esail.simulate("baseline", SAIL | SHORT))
    wanted = 2.0 * last_angle(simulate(eqx.combine(numbers, others), SHORT)) / constant
    assert float(value) == pytest.approx(wanted, rel=1e-9)
    size = sum(jnp.sum(x**2) for x in jax.tree.leaves(slope))
    step = 1e-5 * value / size
    up, down = (
        eqx.apply_updates(numbers, jax.tree.map(lambda g, s=s: s * g, slope)) for s in (step, -step)
    )
    assert float(cost(up) - cost(down)) / (2.0 * step * size) == pytest.approx(1.0, rel=1e-4)
    assert cost(down) < value


@pytest.mark.nightly
def test_members_of_an_ensemble_and_chunks_have_the_law():
    """Members with other spin rates equal single runs by `esail.run`, to rounding (1e-11 of a voltage)."""
    from esail_jax.ensembles import simulate_members

    spins, scene = np.array([4e-3, 4.1e-3]), SAIL | SHORT | {"voltage_law": Swinging()}
    found = simulate_members(
        load_scene("baseline", scene), {"initial.spin_rate": spins}, observables=["voltage"]
    )
    for member, spin in enumerate(spins):
        changed = SAIL | SHORT | {"initial.spin_rate": spin}
        chunks = esail.run("baseline", changed, voltage_law=Swinging(), save=["voltage"])
        rows = np.concatenate([chunk.observables["voltage"] for chunk in chunks])
        assert np.allclose(found["voltage"][member], rows, rtol=1e-11)


# ---- files --------------------------------------------------------------------------------------


def run_file(path, end, law="Swinging", *more):
    keys = ("tethers.count", "tethers.elements", "output.interval")
    settings = [x for key in keys for x in ("--set", f"{key}={SAIL[key]}")]
    named = ["--voltage-law", f"{support.own_laws.__file__}:{law}"] if law else []
    end = ["--t-end", str(end)]
    return main(["run", "baseline", *settings, *named, *end, "-o", str(path), "--quiet", *more])


@pytest.mark.nightly
def test_a_run_resumed_between_two_samples_is_bit_for_bit_the_same(tmp_path):
    """The file holds the voltages and the memory of the law. A run goes on from an end before the first
    sample, from one between two samples, and from one at a sampling instant."""
    once, resumed = tmp_path / "once.h5", tmp_path / "resumed.h5"
    assert run_file(once, 120.0) == 0
    assert run_file(resumed, 3.0) == 0
    for end in (60.0, 70.0, 120.0):
        assert run_file(resumed, end, "Swinging", "--resume") == 0
    one, other = esail.load(once), esail.load(resumed)
    for name in one:
        assert np.array_equal(one[name], other[name], equal_nan=True), name
    assert one.scene.voltage.law == "python"


@pytest.mark.nightly
def test_resuming_asks_for_the_law_of_the_file(tmp_path, capsys):
    """Without the law, or with another one, nothing is computed and the file stays as it is."""
    path = tmp_path / "a.h5"
    assert run_file(path, 60.0) == 0
    before = path.read_bytes()
    for law, got in (("", "is missing"), ("Clock", "is own_laws.Clock")):
        capsys.readouterr()
        assert run_file(path, 120.0, law, "--resume") == 2
        err = capsys.readouterr().err
        assert err.startswith("`--voltage-law` must be own_laws.Swinging") and got in err
        assert err.count("\n") == 1
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("law", "message"),
    [
        ("laws.txt:Law", "must look like FILE.py:NAME, but is 'laws.txt:Law'"),
        ("missing.py:Law", "must name an existing file, but there is no missing.py"),
        ("laws.py:Law", "raises AttributeError: module 'laws' has no attribute 'Law'"),
        ("laws.py:broken", "raises ZeroDivisionError"),
    ],
)
def test_a_law_that_cannot_be_read_is_refused_in_one_line(law, message, tmp_path, monkeypatch, capsys):
    """Nothing is written, and a fault in the user's file is named."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "laws.py").write_text("def broken():\n    return 1 / 0\n", encoding="utf-8")
    assert main(["run", "baseline", "-o", "a.h5", "--voltage-law", law]) == 2
    err = capsys.readouterr().err
    assert err.startswith("`--voltage-law` must ") and message in err and err.count("\n") == 1
    assert not (tmp_path / "a.h5").exists()


# ---- bad input ----------------------------------------------------------------------------------


class Nothing(eqx.Module):
    pass


class Both(eqx.Module):
    period: float = eqx.field(static=True, default=1.0)

    def commanded(self, measurements):
        return 1.0

    def init(self, measurements):
        return 0.0

    def update(self, measurements, memory):
        return 1.0, memory


class TwoVolts(eqx.Module):
    def commanded(self, measurements):
        return jnp.zeros(2)


class Texts(Swinging):
    def init(self, measurements):
        return "nothing"


class Keys(Swinging):
    def init(self, measurements):
        return jax.random.key(0)


class Forgetful(Swinging):
    def update(self, measurements, memory):
        return 20e3, {"before": 0.0}


class Sentence(eqx.Module):
    """A law whose method is given."""

    method: object = eqx.field(static=True)

    def commanded(self, measurements):
        return self.method(measurements)


class Halves(Swinging):
    """A law whose `update` returns what it is told to."""

    found: object = eqx.field(static=True, default=None)

    def update(self, measurements, memory):
        return self.found


def with_if(measurements):
    return 20e3 if measurements.time > 3.0 else 0.0


BAD = {
    "no module": (lambda m: 20e3, {}, "`voltage_law` must be an equinox.Module, but is a function"),
    "no method": (Nothing(), {}, "must have the method `commanded`, .* but Nothing has none of them"),
    "two ways": (Both(), {}, "but Both has commanded and init and update"),
    "period": (Clock(period=-3.0), {}, "`voltage_law.period` must be positive, but is -3.0"),
    "no period": (Clock(period=None), {}, "`voltage_law.period` must be positive, but is None"),
    "slew rate": (Waves(), {"voltage.slew_rate": 3.0}, "`voltage.slew_rate` must be left out unless"),
    "shape": (TwoVolts(), {}, "must return one voltage, or one for each of 3 .* of shape \\(2,\\)"),
    "text": (Texts(), {}, "must have a memory of numbers, but it holds 'nothing'"),
    "key": (Keys(), {}, "must have a memory of numbers, but it holds "),
    "memory": (Forgetful(), {}, "`voltage_law.update` must return a memory like the one before"),
    "None": (Sentence(lambda m: None), {}, "must return voltages \\[V\\], but returned a NoneType"),
    "pair": (Sentence(lambda m: (1.0, {})), {}, "must return voltages \\[V\\], but returned a tuple"),
    "update of None": (Halves(), {}, "`voltage_law.update` must return two things, .* a NoneType"),
    "update of three": (Halves(found=(1, 2, 3)), {}, "the next memory, but returned a tuple of 3"),
    "wrapped": (Delayed(Halves(found=20e3), 1), {}, "`voltage_law.update` must return two .* a float"),
    "misspelt": (Sentence(lambda m: m.wnd), {}, "exist, but .*.py:[0-9]+ uses `wnd` \\(perhaps `wind`\\)"),
    "unknown": (Sentence(lambda m: m.hub_angle), {}, "uses `hub_angle`; there are time, spin_axis"),
    "absent": (
        Sentence(lambda m: 2.0 * m.voltage),
        {},
        "`voltage_law.commanded` must not use measurements that are None here, .*`voltage` \\(needs a "
        "voltage law with a `period`\\), .*but test_own_law.py:[0-9]+ raises TypeError: unsupported",
    ),
    "if": (
        Sentence(with_if),
        {},
        "must use `jnp.where` in place of `if`, .* but test_own_law.py:[0-9]+ raises TracerBool",
    ),
    "numpy": (Sentence(lambda m: np.sin(m.time)), {}, "and `jax.numpy` in place of numpy and `float`"),
    "law": (Waves(), {"voltage.law": "constant"}, '`voltage.law` must be "python" with `voltage_law`'),
    "other key": (Waves(), {"voltage.gain": 1.0}, "`voltage.gain` must be left out with the law python"),
    "no wind": (Waves(), {"solar_wind": None}, "must be given with \\[voltage\\], but is missing"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_law_is_refused_in_one_line_before_anything_is_compiled(case):
    law, overrides, message = BAD[case]
    with pytest.raises(ValueError, match=message) as caught:
        simulate(law, overrides)
    assert "\n" not in str(caught.value)


def test_other_errors_of_a_law_stay_as_they_are():
    """They are those of the user's program."""
    for broken, kind in ((lambda m: 1 / 0, ZeroDivisionError), (lambda m: m.time.nothing, AttributeError)):
        with pytest.raises(kind):
            simulate(Sentence(broken))


def test_a_failed_run_points_at_the_voltages_of_the_law():
    """Where the last sample of a law is not finite, or where its voltages are not sampled."""
    scenes = [load_scene("baseline", SAIL | {"voltage_law": law}) for law in (Waves(), Clock())]
    held = {x: Control(np.array([20e3, x, 20e3]), None) for x in (1e3, np.nan)}
    assert "`voltage_law` that is not finite, or that jumps" in hint_at_law(scenes[0], None, "nonfinite")
    assert "last sample are not finite" in hint_at_law(scenes[1], held[np.nan], "newton_diverged")
    assert hint_at_law(scenes[1], held[1e3], "nonfinite") == ""
    assert hint_at_law(scenes[0], None, "too_many_steps") == ""
    assert hint_at_law(load_scene("baseline"), None, "nonfinite") == ""


@pytest.mark.nightly
def test_a_law_that_gives_nan_is_named_in_the_message_of_the_run():
    with pytest.raises(esail.SimulationError, match="`voltage_law` returned at its last sample are not"):
        simulate(Clock(slope=np.nan), SHORT)


def test_a_scene_that_names_a_law_in_python_needs_it():
    """The TOML text of such a scene is read, but cannot be run without the law."""
    scene = load_scene("baseline", SAIL | {"voltage_law": Waves()})
    again = parse(to_toml(scene), "text")
    assert "voltage law Waves" in repr(scene) and "voltage law" not in repr(again)
    assert again.voltage.law == "python" and again.replace({"voltage_law": Waves()}) == scene
    with pytest.raises(esail.SceneError, match="`voltage_law` must be given with"):
        esail.simulate(again)
    constant = scene.replace({"voltage_law": None, "voltage.law": "constant"})
    assert constant.voltage_law is None and constant.voltage.value == 20e3
    with pytest.raises(esail.SceneError, match="`voltage_law` must be left out with a chain"):
        load_scene("hanging-chain", {"voltage_law": Waves()})


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("run", '`--voltage-law FILE.py:NAME` must be given with `voltage.law` = "python", but is missing'),
        ("design", "must be a law of the package for `esail design`, which takes no `--voltage-law`, but"),
    ],
)
def test_a_command_says_how_it_takes_the_law_of_a_file(command, message, tmp_path, capsys):
    """A file with `law = "python"` and limits is a scene; `esail run` asks for the option that gives the
    law, and `esail design` says that it has none."""
    scene = load_scene("baseline", SAIL | {"voltage_law": Waves(), "voltage.maximum": 40e3})
    (tmp_path / "own.toml").write_text(to_toml(scene), encoding="utf-8")
    assert load_scene(tmp_path / "own.toml", {"voltage_law": Waves()}) == scene
    assert main([command, str(tmp_path / "own.toml"), "-o", str(tmp_path / "out")]) == 2
    err = capsys.readouterr().err
    assert message in err and err.count("\n") == 1 and not (tmp_path / "out").exists()


def test_a_growth_rate_with_samples_is_refused():
    with pytest.raises(esail.SceneError, match="`stability` must be False with a sampled law"):
        simulate(Clock(), stability=True)


class Free(eqx.Module):
    """A law whose period is a parameter, and so traced under a gradient."""

    period: float

    def commanded(self, measurements):
        return 20e3


def test_a_traced_period_is_refused():
    with pytest.raises(esail.SceneError, match="must be a plain number"):
        jax.grad(lambda t: simulate(Free(t))["sailing_angle"][-1])(30.0)


GAIN = 1.0
"""A number that a law reads from outside of itself."""


def scaled_by_gain(volts):
    """A function of the user's own, which reads that number."""
    return GAIN * volts


class Outside(eqx.Module):
    """A law whose method calls a function that reads a global number."""

    volts: jax.Array

    def commanded(self, measurements):
        return scaled_by_gain(self.volts) * jnp.ones_like(measurements.outward[0])


def test_what_a_method_reads_from_outside_is_part_of_the_law(monkeypatch):
    """JAX traces a method once. A global number of another value, also one that only a function reads which
    the method calls, makes another structure, so that programs are compiled again, and another checksum, so
    that a run does not go on under another law. Numbers in fields stay numbers."""
    law = Outside(1e4)
    before, identity = divided(law)[0], identity_of(law)
    assert divided(Outside(2e4))[0] == before and identity_of(Outside(1e4)) == identity
    monkeypatch.setitem(globals(), "GAIN", 2.0)
    assert divided(law)[0] != before and identity_of(law) != identity
    monkeypatch.setitem(globals(), "GAIN", 1.0)
    assert divided(law)[0] == before and identity_of(law) == identity
    monkeypatch.setitem(globals(), "scaled_by_gain", lambda volts: 3.0 * volts)
    assert divided(law)[0] != before and identity_of(law) != identity


class Flagged(eqx.Module):
    """A law whose method depends on what a field is, and on an attribute of its class."""

    flag: object = eqx.field(static=True)
    scale = 1.0

    def commanded(self, measurements):
        return self.scale * jnp.ones_like(measurements.outward[0])


def test_values_that_are_equal_but_not_the_same_make_other_laws():
    """True, 1 and 1.0 are equal in Python, and so are 0.0 and -0.0; a method may differ between them."""
    structures = [divided(Flagged(x))[0] for x in (True, 1, 1.0, 0.0, -0.0)]
    assert len(set(structures)) == 5
    assert divided(Flagged(1.0))[0] == structures[2]


def test_an_attribute_of_the_class_is_part_of_the_law(monkeypatch):
    law = Flagged(True)
    before, identity = divided(law)[0], identity_of(law)
    monkeypatch.setattr(Flagged, "scale", 50.0)
    assert divided(law)[0] != before and identity_of(law) != identity
