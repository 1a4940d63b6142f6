"""A small sail near the Sun, whose tide and wind change by one per cent in 80 seconds."""

import esail_jax as esail

NEAR_SUN = {
    "tethers.count": 3,
    "tethers.length": 1e3,
    "tethers.element": "truss",
    "tethers.elements": 1,
    "tethers.bending": False,
    "tethers.bending_damping_time": None,
    "initial.spin_rate": 0.02,
    "orbit.position_au": [0.008, 0.006, 0.001],
    "orbit.velocity": [-2e5, 2.4e5, 3e4],
    "solar_wind.reference_distance_au": 0.01,
    "integrator.t_end": 80.0,
    "output.interval": 8.0,
}
"""Three tethers of one truss each, so near the Sun that tide and wind change by one per cent in the run."""

SCENE = esail.load_scene("heliocentric", NEAR_SUN)
