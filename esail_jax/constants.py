"""Physical constants in SI units, with the values that [PGV] prints, not with CODATA's latest digits.
Numbers that it does not need are CODATA's."""

PROTON_MASS = 1.67e-27
"""m_i [kg]: mass of a solar-wind proton, [PGV] after Eq. 28."""

VACUUM_PERMITTIVITY = 8.854e-12
"""eps_0 [F/m]: vacuum permittivity, [PGV] after Eq. 27."""

ELEMENTARY_CHARGE = 1.602176634e-19
"""e [C]: elementary charge, exact in the SI since 2019."""

ELECTRON_MASS = 9.1093837139e-31
"""m_e [kg]: mass of an electron, CODATA 2022."""

ATOMIC_MASS = 1.66053906892e-27
"""u [kg]: atomic mass constant, CODATA 2022."""

THRUST_FACTOR = 0.18
"""Coefficient [-] of the Coulomb thrust per unit length, [PGV] Eq. 27 (Janhunen et al. 2010)."""

ASTRONOMICAL_UNIT = 1.495978707e11
"""Astronomical unit [m]: IAU 2012 definition."""

STEFAN_BOLTZMANN = 5.670374419e-8
"""Stefan-Boltzmann constant sigma [W/(m^2 K^4)] (CODATA 2018; exact but for its digits)."""

SOLAR_CONSTANT = 1361.0
"""Flux of sunlight at 1 au [W/m^2] (Kopp & Lean 2011)."""
SOLAR_MU = 1.32712440018e20
"""mu [m^3/s^2]: gravitational constant times the mass of the Sun (Standish 1998, JPL DE405)."""

SOLAR_RADIUS = 6.957e8
"""Nominal radius of the Sun [m]: IAU 2015 resolution B3."""

DEBYE_LENGTHS = 2.0
"""Distance r_0 at which the wire's potential vanishes, in Debye lengths (Janhunen & Sandroos 2007)."""

SLOW_SPIN = 1e-5
"""Spin rate [rad/s] below which the sense of the spin fades: a turn in a week."""
