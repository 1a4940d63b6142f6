"""Conservation of energy and momenta in whole runs, and the energy theorem."""

import numpy as np
import pytest

import esail_jax as esail
from esail_jax.simulation.host import compile_scene


def energy(run):
    """Kinetic plus elastic energy [J] by saved instant."""
    return np.asarray(run["kinetic_energy"] + run["elastic_energy"])


@pytest.mark.nightly
def test_free_spinning_sail_keeps_energy_and_spin(small, validate):
    """A free sail without wind keeps energy and spin rate over one spin period, to 1e-8.

    The initial state is a steady motion of the semi-discrete model, which generalized-alpha keeps but for
    an offset at the start. 1e-8 allows for the rounding of other machines.
    """
    times = {"integrator.t_end": 1570.0, "output.interval": 50.0}
    # Few tests share this structure, and the program of few observables compiles faster.
    names = ("kinetic_energy", "elastic_energy", "angular_velocity_B")
    run = esail.simulate("voltage-off", small | times, save=names)
    case, reference = "free spinning sail, one period", "conservation"
    validate("CSV-1", case, reference, "energy", np.abs(energy(run) / energy(run)[0] - 1.0).max(), 1e-8)
    spin = run["angular_velocity_B"][:, 0]
    validate("CSV-2", case, reference, "spin rate", np.abs(spin / spin[0] - 1.0).max(), 1e-8)
    violation = run.numerics["constraint_violation"].max()
    validate("CSV-3", case, "constraint equations", "largest violation", violation, 1e-9, "m")


@pytest.mark.nightly
def test_energy_error_of_a_free_sail_falls_with_the_step(small):
    """The energy error falls at least four times per halving of the step.

    The steps are large, so that the error is the method's and not rounding.
    """
    changes = []
    for step in (1.6, 0.8):
        settings = {**small, "initial.spin_rate": 0.04, "integrator.t_end": 160.0}
        # The number of steps between saved instants is the same, so that both runs share one program.
        steps = {"integrator.step": step, "output.interval": 10 * step}
        run = esail.simulate("voltage-off", settings | steps)
        changes.append(np.abs(energy(run) / energy(run)[0] - 1.0).max())
    assert changes[0] > 4.0 * changes[1] > 0.0


def test_roots_stay_on_the_hub(small):
    """The roots stay on the hub over 6000 steps, to rounding of 1 m.

    Spherical joints are satisfied by construction. If roots and hub were only integrated alike, their
    difference would grow with the fourth power of time.
    """
    settings = {**small, "integrator.t_end": 600.0}
    run = esail.simulate("baseline", settings)
    assert run.checkpoint.motion.state.time == run.time[-1]
    state = run.checkpoint.motion.state.now
    roots = compile_scene(esail.load_scene("baseline", settings)).problem.system.roots
    for x, rounding in ((state.q, 1e-12), (state.v, 1e-14), (state.vdot, 1e-16)):
        assert np.abs(x.tether[0, :, 0] - roots.positions(x.hub)).max() < rounding


@pytest.mark.nightly
def test_energy_of_the_baseline_without_wind(validate):
    """Over three periods the energy loss is the method's numerical dissipation, of third order in the
    step."""
    found = []
    for step in (0.4, 0.2, 0.1):
        run = esail.simulate("voltage-off", {"integrator.step": step})
        found.append(np.abs(energy(run) / energy(run)[0] - 1.0).max())
    case, reference = "baseline without wind, 3 periods", "conservation"
    validate("CSV-6", case, reference, "energy, h = 0.1 s", found[-1], 1e-9)
    orders = np.log2(np.array(found[:-1]) / found[1:])
    validate("CSV-7", case, reference, "order in h, distance from 3", np.abs(orders - 3.0).max(), 0.1)


@pytest.mark.nightly
def test_angular_momentum_of_a_free_unequal_sail_is_constant(small, validate):
    """The angular momentum about the origin, from nodal positions and momenta, is constant without
    external forces."""
    settings = {**small, "remote_units.mass": [1.5, 1.0, 2.0], "integrator.t_end": 200.0}
    scene = esail.load_scene("voltage-off").replace({**settings, "output.interval": 200.0})
    compiled, run = compile_scene(scene), esail.simulate(scene)

    def momentum(q, v):
        system = compiled.problem.system
        p_tether, p_hub = system.tethers.inertia(v.tether), system.hub.mass_matrix @ v.hub
        tether = np.cross(q.tether, p_tether, axis=1).sum((0, 2, 3))
        return tether + np.cross(np.asarray(q.hub), np.asarray(p_hub)).sum(0)

    begun = compiled.motion.state.now
    start = momentum(begun.q, begun.v)
    end = momentum(run.final_state.q, run.final_state.v)
    # The motion is unsteady; the error is of second order in omega h = 4e-4.
    error = np.abs(end - start).max() / np.abs(start).max()
    validate(
        "CSV-4", "free sail, unequal tip masses", "conservation", "angular momentum, 200 s", error, 1e-7
    )


def test_energy_theorem_closes_for_a_driven_damped_sail(small, validate):
    """dE = W - D holds with wind and damping, to the error of the trapezoidal rule and of the method."""
    run = esail.simulate("baseline", {**small, "integrator.t_end": 400.0})
    error = np.abs(run["energy_balance_error"]).max() / np.abs(run["external_work"]).max()
    validate("CSV-5", "driven, damped sail", "dE = W - D", "balance / work, 400 s", error, 1e-5)
    assert run["dissipated_energy"][-1] > 0.0


@pytest.mark.nightly
def test_energy_theorem_closes_for_a_turning_frame():
    """Without a hub the frame does work through the root reactions, which counts as external work."""
    drop = {"tethers.count": 2, "tethers.elements": 2, "integrator.t_end": 200.0}
    scene = without(esail.load_scene("baseline").replace(drop), "hub")
    run = esail.simulate(scene)
    change = np.ptp(energy(run))
    assert np.abs(run["energy_balance_error"]).max() < 2e-3 * change
    assert run.stats["terms"][0] == "turning frame"


@pytest.mark.nightly
@pytest.mark.parametrize("drop_hub", [False, True])
def test_uniform_gravity_is_free_fall_and_does_work(small, drop_hub):
    """A free sail in uniform gravity falls by r = g t^2/2; the energy theorem includes the work of gravity.

    Held by a fixed frame, the work of gravity and of the frame close the energy theorem.
    """
    g = [0.01, -0.02, 0.005]
    scene = esail.load_scene("voltage-off").replace({**small, "gravity.acceleration": g})
    if drop_hub:
        run = esail.simulate(without(scene, "hub"))
        assert np.abs(run["energy_balance_error"]).max() < 1e-4 * np.abs(run["external_work"]).max()
        return
    run = esail.simulate(scene)
    fall = 0.5 * np.outer(run.time**2, g)
    assert np.abs(run["hub_position_I"] - fall).max() < 1e-9
    assert np.abs(run["energy_balance_error"]).max() < 1e-6 * np.abs(run["external_work"]).max()


def without(scene, *tables):
    """The scene without some of its tables."""
    import dataclasses

    return dataclasses.replace(scene, **dict.fromkeys(tables))
