"""A sail of five unequal tethers, joined by unequal auxiliary tethers, for the package and for the
independent simulator `ring_reference.py`."""

import numpy as np

import esail_jax as esail
from support.ring_reference import AU, CUTOFF, DENSITY, SPEED, Sail

SAIL = {
    "hub.height": 2.0,
    "hub.radius": 1.0,
    "hub.density": 100.0,
    "tethers.count": 5,
    "tethers.length": [1000.0, 1004.0, 997.0, 1002.0, 999.0],
    "tethers.area": 4.28e-9,
    "tethers.density": 7653.0,
    "tethers.youngs_modulus": 7e9,
    "tethers.element": "truss",
    "tethers.elements": 2,
    "tethers.axial_damping_time": [0.3, 0.4, 0.5, 0.3, 0.4],
    "auxiliary_tethers.length": [1174.0, 1175.0, 1176.0, 1175.5, 1174.5],
    "auxiliary_tethers.area": [3e-9, 4e-9, 3e-9, 5e-9, 3e-9],
    "auxiliary_tethers.density": 1400.0,
    "auxiliary_tethers.youngs_modulus": 5e9,
    "auxiliary_tethers.axial_damping_time": [0.5, 0.6, 0.5, 0.4, 0.5],
    "remote_units.mass": [0.5, 0.6, 0.4, 0.55, 0.45],
    "solar_wind.speed": SPEED,
    "solar_wind.number_density": DENSITY,
    "solar_wind.cutoff_voltage": CUTOFF,
    "voltage.value": [20e3, 10e3, 15e3, 22e3, 18e3],
    "initial.spin_rate": 0.02,
    "initial.sailing_angle_deg": 20.0,
    "integrator.t_end": 60.0,
    "output.interval": 5.0,
}

TIGHT = {"integrator.tolerance": 1e-13}

EACH = np.array([1.0, 0.5, -0.7, 0.3, 0.9])
"""Direction in which the numbers of five segments change."""

RING_NUMBERS = {
    "auxiliary_tethers.length": (1175.0, 0.1),
    "auxiliary_tethers.area": (3e-9, 1e-11),
    "auxiliary_tethers.density": (1400.0, 10.0),
    "auxiliary_tethers.youngs_modulus": (5e9, 2e7),
    "auxiliary_tethers.axial_damping_time": (0.5, 0.02),
    "auxiliary_tethers.slack_strain": (0.03, 2e-4),
}
"""Numbers of the ring, and their changes in a difference quotient. The strain of the ring is about 6e-3,
less than half the width of the tension-only law, so that the width matters too."""

TRUSSES = {"auxiliary_tethers.elements": 2, "tethers.strain": "engineering"}
TRUSSES |= {key: (value + 10.0 * size * EACH).tolist() for key, (value, size) in RING_NUMBERS.items()}
"""A ring of two trusses in a segment, all of whose numbers differ from segment to segment. Runs and
derivatives with this structure share their programs."""


def ring_scene(changes=()):
    """The scene with other values by key."""
    values = SAIL | dict(changes)
    tables = {}
    for key, value in values.items():
        table, name = key.split(".")
        if value is not None:
            tables.setdefault(table, {})[name] = value

    def made(table, kind):
        return kind(**tables[table]) if table in tables else None

    return esail.load_scene(esail.Scene(
        hub=esail.Hub(**tables["hub"]) if "hub" in tables else None,
        tethers=esail.Tethers(**tables["tethers"]),
        auxiliary_tethers=made("auxiliary_tethers", esail.AuxiliaryTethers),
        orbit=made("orbit", esail.HeliocentricOrbit),
        remote_units=esail.RemoteUnits(**tables["remote_units"]),
        solar_wind=esail.SolarWind(**tables["solar_wind"]) if "solar_wind" in tables else None,
        voltage=esail.Voltage(**tables["voltage"]) if "voltage" in tables else None,
        thermal=esail.Thermal(**tables["thermal"]) if "thermal" in tables else None,
        initial=esail.Initial(**tables["initial"]),
        integrator=esail.Integrator(**tables["integrator"]),
        output=esail.Output(**tables["output"]),
    ))  # fmt: skip


def reference(scene):
    """The independent simulator of a scene."""
    p = scene.tethers.count

    def each(value):
        return np.broadcast_to(np.asarray(value, float), (p,)).copy()

    def chain(table):
        return {
            "kind": table.element,
            "elements": table.elements,
            "length": each(table.length),
            "area": each(table.area),
            "density": each(table.density),
            "modulus": each(table.youngs_modulus),
            "damping": each(table.axial_damping_time or 0.0),
        }

    ring, hub, orbit, natural = scene.auxiliary_tethers, scene.hub, scene.orbit, None
    if ring is not None:
        ring = chain(ring) | {"slack": None if ring.slack_strain is None else each(ring.slack_strain)}
    if scene.thermal is not None:
        heat = scene.thermal
        natural = heat.expansion * (np.array(heat.temperature) - heat.reference_temperature)
        natural = np.array(heat.time), natural
    if orbit is not None:
        distance = AU * (scene.solar_wind.reference_distance_au or 1.0)
        orbit = (AU * np.array(orbit.position_au), np.array(orbit.velocity), distance)
    body = hub.height, hub.radius, hub.density
    if hub.mass is not None:
        body = {name: getattr(hub, name) for name in ("mass", "inertia", "centre", "roots")}
    return Sail(
        chain(scene.tethers),
        ring,
        each(scene.remote_units.mass),
        each(scene.voltage.value),
        body,
        scene.initial.spin_rate,
        np.deg2rad(scene.initial.sailing_angle_deg),
        scene.tethers.strain,
        natural,
        orbit,
        scene.solar_wind.relative,
    )


def check_second_order(scene, save=()):
    """Compares generalized-alpha and energy-momentum at t = 8 and 16 s with the independent code: errors
    of tips and auxiliary tension fall by 3.5 to 4.5 for half the step (order two: 4). Returns the last run,
    of energy-momentum with a step of 0.05 s, with the observables `save` as well."""
    names = ("tip_position_I", "auxiliary_tension")
    exact = reference(ring_scene(scene | TIGHT)).run(np.arange(0.0, 17.0, 8.0))
    for method in ("generalized-alpha", "energy-momentum"):
        found = []
        for step, stride in ((0.1, 1), (0.05, 2)):
            # The same number of steps between saved instants, so that both runs share one program.
            settings = {"integrator.method": method, "integrator.step": step, "output.interval": 80 * step}
            run = esail.simulate(ring_scene(scene | settings), save=(*names, *save))
            tips, tension = (np.asarray(run[x])[::stride] for x in names)
            size = np.abs(tips - exact["tip_position_I"]).max()
            found.append((size, np.abs(tension - exact["auxiliary_tension"]).max()))
        ratios = np.divide(*found)
        assert ((ratios > 3.5) & (ratios < 4.5)).all(), (method, ratios)
    return run
