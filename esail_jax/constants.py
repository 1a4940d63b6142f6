"""Physical constants in SI units, with the values that [PGV] prints, not with CODATA's latest digits."""

PROTON_MASS = 1.67e-27
"""m_i [kg]: mass of a solar-wind proton, [PGV] after Eq. 28."""

VACUUM_PERMITTIVITY = 8.854e-12
"""eps_0 [F/m]: vacuum permittivity, [PGV] after Eq. 27."""

THRUST_FACTOR = 0.18
"""Coefficient [-] of the Coulomb thrust per unit length, [PGV] Eq. 27 (Janhunen et al. 2010)."""

ASTRONOMICAL_UNIT = 1.495978707e11
"""Astronomical unit [m]: IAU 2012 definition."""
