"""The rigid pendulum that a tether would be without flexibility ([PGV] Eq. 83-85, derived).

A rigid uniform tether (mass m_t, length L) with a tip mass m_u hangs from a hinge at distance R from
an axis X that turns at a constant rate w. With (X, r, s) turning along, r outward through the hinge
and s = X x r, the point at distance l from the hinge is at

    R r + l n,    n = sin(gamma) X + cos(gamma) (cos(beta) r + sin(beta) s).

Its velocity in an inertial frame gives, up to a total time derivative, the Lagrangian

    I gamma'^2 / 2 + I cos(gamma)^2 (w + beta')^2 / 2 + w^2 R S cos(gamma) cos(beta),

    I = (m_u + m_t / 3) L^2,    S = (m_u + m_t / 2) L,

hence, to first order, and with the lowest-order coupling in the second equation,

    gamma'' + w^2 (1 + eps) gamma = -M_s / I,
    beta''  + w^2 eps beta        =  M_X / I + 2 w gamma gamma',

    eps = R S / (I) = (R / L) (m_u + m_t / 2) / (m_u + m_t / 3).

M is the moment of the load about the hinge; a rotation that raises coning is about -s. For R = 0 and
M_X = 0 the second equation is the conservation of I cos(gamma)^2 (w + beta') to this order.

Eq. 83 and 84 agree, where the paper's components of M, in the body frame, are those along X and s for
tether 1 only. Eq. 85 has half the coupling: its w gamma gamma' must be 2 w gamma gamma'.
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
