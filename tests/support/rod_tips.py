"""Tips of rod chains."""

import numpy as np

STEEL_TIP = (0.16759854201778534, 0.99333995457918311, 0.0)
"""[m] of experiment 2 at 1 s, by Gauss collocation of order 16 in long
double and by a program in quadruple precision (`experiments/mw_rods/reference.py`)."""


def tip(solution):
    joints = solution["joint_position"]
    return np.asarray(joints[:, -1] - joints[:, 0])
