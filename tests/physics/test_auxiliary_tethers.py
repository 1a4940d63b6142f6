"""Auxiliary tethers: exact cases, an independent simulator, and conservation.

Runs whose scenes have the structure of `support.ring_sail.TRUSSES` share its programs, also with those of
`test_ring_numbers.py`.
"""

import numpy as np
import pytest

import esail_jax as esail
from support.ring_sail import SAIL, TIGHT, TRUSSES, check_second_order, reference, ring_scene

REFERENCE = "independent NumPy code (`support/ring_reference.py`), Dormand & Prince 8(5,3)"

RINGS = {
    # Two elements in a segment, which are slack over a wide range of strain.
    "trusses": TRUSSES,
    "cables": {
        "auxiliary_tethers.element": "cable",
        "tethers.element": "cable",
        "tethers.elements": 1,
        # Less damping: the explicit reference keeps overdamped slopes at its stability limit.
        "tethers.axial_damping_time": 0.02,
        "auxiliary_tethers.axial_damping_time": [0.02, 0.03, 0.02, 0.01, 0.02],
    },
    "slack": {
        # Voltages that pull the tips apart by metres: two segments go slack and taut again.
        "auxiliary_tethers.slack_strain": [1e-4, 2e-4, 1e-4, 3e-4, 1e-4],
        "auxiliary_tethers.length": [1174.0, 1180.0, 1176.0, 1181.0, 1174.5],
        "auxiliary_tethers.strain": "green-lagrange",
    },
}
"""Rings of trusses with engineering strain, of cables that push as they pull, and with slack segments."""


def range_errors(solution, exact):
    """Largest error of every signal over the range of that signal, over time and components."""
    return {
        name: np.abs(np.asarray(solution[name]) - values).max() / np.ptp(values)
        for name, values in exact.items()
    }


@pytest.mark.nightly
@pytest.mark.parametrize(
    "ring", [ring if ring == "slack" else pytest.param(ring, marks=pytest.mark.nightly) for ring in RINGS]
)
def test_run_follows_an_independent_integration(ring, validate):
    """Every signal of five unequal tethers with a ring agrees with the independent code to 1e-6 of its
    range.

    Measured: positions 1e-13, tensions 1e-7, dissipated power, which is small, 1e-7."""
    scene = ring_scene(RINGS[ring] | TIGHT)
    solution = esail.simulate(scene)
    exact = reference(scene).run(np.asarray(solution.time))
    found = range_errors(solution, exact)
    worst = max(found, key=found.get)
    quantity = f"worst of {len(found)} signals / range"
    validate(
        f"RING-{ring}", f"five unequal tethers, ring of {ring}", REFERENCE, quantity, found[worst], 1e-6
    )


@pytest.mark.nightly
def test_methods_with_fixed_steps_are_of_second_order():
    """The errors of generalized-alpha and energy-momentum fall by 3.5 to 4.5 for half the step (order two:
    4), with a ring of two trusses per segment."""
    check_second_order({"auxiliary_tethers.elements": 2, "integrator.t_end": 16.0})


# ---- exact cases --------------------------------------------------------------------------------

ENDS = ("tip_position_I", "auxiliary_tension")
"""The observables of the exact cases, which share the program that evaluates them."""

EQUAL = {
    "tethers.count": 6,
    "tethers.length": 1000.0,
    "tethers.elements": 1,
    "tethers.density": 1e-3,
    "tethers.axial_damping_time": None,
    "auxiliary_tethers.length": 990.0,
    "auxiliary_tethers.area": 3e-9,
    "auxiliary_tethers.density": 1e-3,
    "auxiliary_tethers.axial_damping_time": None,
    "remote_units.mass": 0.5,
    "solar_wind.speed": None,
    "solar_wind.number_density": None,
    "solar_wind.cutoff_voltage": None,
    "voltage.value": None,
    "initial.spin_rate": 0.05,
    "integrator.t_end": 40.0,
    "output.interval": 0.5,
}
"""Six equal point masses on all but massless springs: an exact ring. EA of the tethers is 29.96 N, that of
the ring 15 N."""


def ring_of_points(scene):
    """Radius [m] of the masses, tension [N] of the segments and breathing frequency [rad/s] about it.

    With rho the radius, chord c = 2 rho sin(pi/p) and Green-Lagrange springs, N(x, L) = EA ((x/L)^2 - 1)/2
    (x/L) is the force of a spring of length x. Balance: N_t(rho - R) + 2 N_a(c) sin(pi/p) = m rho w^2.
    Breathing with constant angular momentum per mass: m s'' = -(dN_t + 4 dN_a sin^2(pi/p) + 3 m w^2) s."""
    import scipy.optimize

    t, a = scene.tethers, scene.auxiliary_tethers
    p, m, w = t.count, scene.remote_units.mass, scene.initial.spin_rate
    sine, radius = np.sin(np.pi / p), scene.hub.radius

    def force(x, length, axial):
        return 0.5 * axial * ((x / length) ** 2 - 1.0) * x / length

    def slope(x, length, axial):
        return 0.5 * axial * (3.0 * (x / length) ** 2 - 1.0) / length

    stiff = (t.youngs_modulus * t.area, a.youngs_modulus * a.area)

    def left(rho):
        pull = force(rho - radius, t.length, stiff[0]) + 2.0 * sine * force(
            2 * rho * sine, a.length, stiff[1]
        )
        return pull - m * rho * w**2

    rho = scipy.optimize.brentq(left, 500.0, 2000.0, xtol=1e-12)
    breathing = slope(rho - radius, t.length, stiff[0]) + 4.0 * sine**2 * slope(
        2 * rho * sine, a.length, stiff[1]
    )
    return rho, force(2 * rho * sine, a.length, stiff[1]), np.sqrt(breathing / m + 3.0 * w**2)


@pytest.mark.nightly
def test_ring_of_point_masses_in_equilibrium(validate):
    """Equal masses on springs stay at the radius at which tethers and ring balance the centrifugal force.

    1e-8 allows for the springs' own mass, 1e-9 of that of the units."""
    scene = ring_scene(EQUAL)
    rho, tension, _ = ring_of_points(scene)
    run = esail.simulate(scene, save=ENDS)
    distance = np.linalg.norm(np.asarray(run["tip_position_I"]), axis=-1)
    case, exact = "six equal masses joined by springs", "closed form: N_t + 2 N_a sin(pi/p) = m r w^2"
    validate("RING-1", case, exact, "radius, relative", np.abs(distance / rho - 1.0).max(), 1e-8)
    error = np.abs(np.asarray(run["auxiliary_tension"]) / tension - 1.0).max()
    validate("RING-2", case, exact, "tension, relative", error, 1e-7)
    assert tension > 0.1


@pytest.mark.nightly
@pytest.mark.parametrize("element", ["truss", "cable"])
def test_breathing_of_a_ring_of_point_masses(element, validate):
    """The masses breathe with the frequency of springs and spin, if the spin is not that of the start.

    The hub is heavy and turns on at the changed rate, so that the tethers lag a little: each keeps its
    angular momentum but for the moment N R / rho of the hub's radius R = 1 mm. The amplitude is 1e-6 of the
    radius; 2e-4 allows for the frequency from crossings of a sampled curve."""
    from esail_jax.scenes.structure import split
    from esail_jax.steppers.stepper import Point
    from esail_jax.system import Power
    from support.quick import build_jitted

    scene = ring_scene(EQUAL | {"auxiliary_tethers.element": element, "hub.radius": 1e-3})
    rho, _, rate = ring_of_points(scene)
    model = build_jitted(*split(scene))
    zero = np.zeros(())
    v = model.v._replace(**{k: 1.00001 * x for k, x in model.v._asdict().items() if x is not None})
    start = Point(zero, model.q, v, Power(zero, zero), np.asarray(True))
    run = esail.simulate(scene, start=start, save=ENDS)
    distance = np.linalg.norm(np.asarray(run["tip_position_I"])[:, 0], axis=-1)
    # Least squares for the frequency: mean, cosine and sine.
    import scipy.optimize

    def rest(omega):
        phase = omega * np.asarray(run.time)
        basis = np.stack([np.ones_like(phase), np.cos(phase), np.sin(phase)], 1)
        return np.linalg.norm(distance - basis @ np.linalg.lstsq(basis, distance, rcond=None)[0])

    found = scipy.optimize.minimize_scalar(rest, bounds=(0.8 * rate, 1.2 * rate), method="bounded",
                                           options={"xatol": 1e-9}).x  # fmt: skip
    case, exact = f"breathing of six masses, ring of {element} elements", "closed form"
    validate(f"RING-3-{element}", case, exact, "frequency, relative", abs(found / rate - 1.0), 2e-4)
    assert np.ptp(distance) > 1e-7 * rho


# ---- conservation -------------------------------------------------------------------------------


@pytest.mark.nightly
def test_free_sail_with_a_ring_keeps_energy_and_momenta(validate):
    """Without wind and damping energy-momentum keeps energy, momentum and angular momentum of an unequal
    sail with a tension-only ring of cables, to rounding of the iterations."""
    import jax

    from esail_jax.simulation.host import compile_scene

    quiet = {key: None for key in EQUAL if EQUAL[key] is None}
    changes = {
        "auxiliary_tethers.element": "cable",
        "auxiliary_tethers.elements": 2,
        "auxiliary_tethers.slack_strain": 1e-4,
        "initial.coning_angle_deg": 10.0,
        "integrator.method": "energy-momentum",
        "integrator.step": 0.1,
        "integrator.t_end": 20.0,
        "output.interval": 20.0,
    }
    scene = ring_scene(quiet | changes)
    energies = ("kinetic_energy", "elastic_energy")
    run = esail.simulate(scene, save=energies)
    system = compile_scene(scene, names=energies).problem.system
    energy = np.asarray(run["kinetic_energy"] + run["elastic_energy"])
    case, what = "free unequal sail with a ring", "conservation"
    validate("RING-4", case, what, "energy, relative", np.abs(energy / energy[0] - 1.0).max(), 1e-11)

    @jax.jit
    def momenta(q, v):
        m = system.momenta(v)
        turning = jax.numpy.cross(q.hub, m.hub).sum(0)
        turning += jax.numpy.cross(q.tether, m.tether, axis=1).sum((0, 2, 3))
        turning += jax.numpy.cross(q.ring, m.ring, axis=0).sum((1, 2))
        return system.momentum(v), turning

    final = run.final_state
    first = {"integrator.t_end": 1e-6, "output.interval": 20.0}
    start = esail.simulate(scene, first, save=energies).final_state
    before, after = (momenta(x.q, x.v) for x in (start, final))
    size = np.abs(before[1]).max()
    validate("RING-5", case, what, "angular momentum", np.abs(before[1] - after[1]).max() / size, 1e-10)
    speed = np.abs(np.asarray(final.v.tether)).max()
    assert np.abs(before[0] - after[0]).max() < 1e-11 * speed


# ---- roots ---------------------------------------------------------------------------------------


@pytest.mark.nightly
def test_ring_on_a_turning_frame_is_that_on_a_heavy_hub(validate):
    """A hub that is far heavier than the tethers holds their roots as the frame does, 1 mm from the axis
    where the frame has them on it: the tensions of the ring agree to the strain of 1 mm, 2e-4."""
    short = RINGS["slack"] | {"auxiliary_tethers.length": SAIL["auxiliary_tethers.length"]}
    short |= {"integrator.t_end": 20.0}
    frame = dict.fromkeys(("hub.height", "hub.radius", "hub.density"))
    heavy = {"hub.height": 1e-3, "hub.radius": 1e-3, "hub.density": 1e16}
    # The second run has the programs of the ring "slack".
    first = esail.simulate(ring_scene(short | frame), save=("auxiliary_tension",))
    second = esail.simulate(ring_scene(short | heavy))
    first, second = (np.asarray(run["auxiliary_tension"]) for run in (first, second))
    error = np.abs(first / second - 1.0).max()
    case, reference = "ring on a turning frame", "ring on a heavy hub"
    validate("RING-7", case, reference, "tension, relative", error, 3e-4)


@pytest.mark.nightly
def test_ring_with_clamped_roots_balances_its_energy():
    """Roots that are clamped to the hub do not disturb the ring: energy, work and dissipation balance to
    the tolerance of the run, and the segments stay taut."""
    clamped = {
        "tethers.element": "cable",
        "tethers.elements": 1,
        "tethers.root": "clamped",
        "tethers.bending": True,
        "tethers.second_moment": 1.47e-18,
        "integrator.t_end": 20.0,
    }
    names = ("energy_balance_error", "kinetic_energy", "auxiliary_tension")
    run = esail.simulate(ring_scene(clamped), save=names)
    balance = np.abs(np.asarray(run["energy_balance_error"])).max()
    assert balance < 1e-6 * np.asarray(run["kinetic_energy"])[0]
    assert run.numerics["constraint_violation"].max() < 1e-9
    assert (np.asarray(run["auxiliary_tension"]) > 0.0).all()
