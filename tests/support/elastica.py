"""The inextensible elastica in closed form."""

import numpy as np
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

TIP_ANGLE = np.deg2rad(50.0)
"""Angle of the tip from the unloaded direction [rad]."""


def elliptic(tip_angle):
    """alpha^2 = P L^2 / EI and the tip (along, down) / L for a given angle of the tip [rad].

    `physics/systems/test_elastica.py` gives the equations.
    """
    m = 0.5 * (1.0 + np.sin(tip_angle))
    phi = np.arcsin(1.0 / np.sqrt(2.0 * m))
    alpha = ellipk(m) - ellipkinc(phi, m)
    along = np.sqrt(2.0 * np.sin(tip_angle)) / alpha
    return alpha**2, np.array([along, 1.0 - 2.0 * (ellipe(m) - ellipeinc(phi, m)) / alpha])
