"""A small sail of two unequal tethers whose motors hold a tension."""

UNEQUAL = {
    "hub.density": 100.0,
    "hub.height": 1.0,
    "tethers.count": 2,
    "tethers.length": 1000.0,
    "tethers.elements": 2,
    "tethers.bending_damping_time": None,
    "remote_units.mass": [0.5, 0.6],
    "initial.spin_rate": 0.06,
    "initial.sailing_angle_deg": 0.0,
    "deployment.start_length": [50.0, 60.0],
    "deployment.law": "tension",
    "deployment.drum_mass": [3.0, 4.0],
    "integrator.t_end": 60.0,
    "output.interval": 5.0,
}
TABLE = {
    "deployment.time": [0.0, 25.0],
    "deployment.tension": [[0.1, 0.12], [0.06, 0.09]],
}
CALM = UNEQUAL | TABLE | {"solar_wind": None, "voltage": None}
LIGHT = CALM | {"tethers.axial_damping_time": None}
WITHOUT_TABLE = {key: x for key, x in CALM.items() if key not in TABLE}
