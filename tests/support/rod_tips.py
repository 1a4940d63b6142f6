"""Tip positions of rod chains."""

import numpy as np

STEEL_TIP = (0.16759854201778534, 0.99333995457918311, 0.0)
"""Tip [m] of [MW]'s experiment 2 at 1 s. Gauss collocation of order 16 in long double and a program in
quadruple precision agree on it (`experiments/mw_rods/reference.py`)."""


def tip(solution):
    """The position of the last joint relative to the first, by saved instant (time, 3) [m]."""
    joints = solution["joint_position"]
    return np.asarray(joints[:, -1] - joints[:, 0])
