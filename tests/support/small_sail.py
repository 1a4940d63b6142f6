"""The scene file of a small sail, for tests of scenes and of the command.

The sail has a hub, two tethers of two cable elements, and wind. Some saved instants coincide with the end
of a step and some lie within a step; a compiled call ends between two saved instants.
"""

TEXT = """\
[hub]
height = 2.0
radius = 1.0
density = 884.0

[tethers]
count = 2
length = 10e3
area = 4.28e-9
density = 7653.0
youngs_modulus = 70e9
elements = 2
axial_damping_time = 1.0

[remote_units]
mass = 1.5

[solar_wind]
speed = 4e5
number_density = 7.3e6
cutoff_voltage = 1e3

[voltage]
value = 20e3

[initial]
spin_rate = 4e-3
sailing_angle_deg = 10.0

[integrator]
t_end = 80.0
step = 0.1

[output]
interval = 0.35
"""
