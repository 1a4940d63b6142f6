"""The scene file of a small chain of rods, for tests of scenes and of run files."""

TEXT = """\
[chain]
rods = 3
mass = [0.1, 0.2, 0.1]
length = 0.5
area = 1e-6
youngs_modulus = 1e9
[gravity]
acceleration = [0.0, -9.81, 0.0]
[initial]
rod_vector = [[0.0, -0.5, 0.0], [0.0, -0.5, 0.0], [0.5, 0.0, 0.0]]
rod_rate = [1.0, 0.0, 0.0]
[integrator]
t_end = 1.0
[output]
interval = 0.02
"""
