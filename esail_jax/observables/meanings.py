"""What every observable means, in one sentence with the sense in which it is positive, and in another one
what becomes of it when a tether is released.

X_B is the axis of the hub about which the sail spins, Z_O the direction away from the Sun.
"""

FIRST_SENTENCES = {
    "coning_angle": "Angle of the line from root to tip out of the spin plane, positive towards X_B.",
    "lagging_angle": (
        "Angle of the line from root to tip within the spin plane, from the radial direction of the "
        "root, positive in the sense of the spin."
    ),
    "root_coning_angle": "Angle of the tangent at the root out of the spin plane, positive towards X_B.",
    "root_lagging_angle": (
        "Angle of the tangent at the root within the spin plane, from the radial direction, positive in "
        "the sense of the spin."
    ),
    "tether_length": "Length of the deformed tether.",
    "max_axial_strain": (
        "Largest axial strain along the tether, in the strain measure of the scene; positive in tension."
    ),
    "angular_velocity_B": (
        "Angular velocity of the hub relative to inertial axes; its first component is the spin rate."
    ),
    "euler_hub": "Angles of the sequence Z-Y-X that turn the axes O into the axes of the hub.",
    "euler_sail": (
        "Angles of the sequence Z-Y-X that turn the axes O into those of the sail: the normal of the "
        "mean plane of the tips, and the direction of tip 1."
    ),
    "sailing_angle": "Angle between X_B and Z_O, never negative.",
    "precession_angle": (
        "Angle of the normal of the sail about Z_O, from X_O towards Y_O; NaN while the normal is parallel "
        "to Z_O but for rounding."
    ),
    "tip_position_I": "Position of the tip, which is that of the remote unit if there is one.",
    "hub_position_I": "Position of the centre of the hub.",
    "hub_velocity_I": "Velocity of the centre of the hub.",
    "rotation_IB": (
        "Rotation matrix that maps components along the axes of the hub to inertial ones; its columns "
        "are the axes of the hub."
    ),
    "thrust_O": "Thrust of the solar wind on all tethers.",
    "thrust_moment_O": "Sum of the moments of the thrust of every tether about its own root.",
    "reaction_O": "Sum of the forces of the hub on the tethers.",
    "reaction_moment_O": (
        "Moment of the forces of the hub on the tethers about the centre of the hub, with the couples "
        "of clamped roots."
    ),
    "thrust_B": "Thrust of the solar wind on a tether.",
    "thrust_moment_B": "Moment of the thrust on a tether about its root.",
    "reaction_B": "Force of the hub on the root of a tether; it points inwards if the tether is taut.",
    "thrust_angle": "Angle between the thrust and Z_O, never negative; NaN without thrust.",
    "reaction_angle": (
        "Angle between the sum of the root reactions and Z_O, never negative; NaN while the reactions "
        "balance each other but for rounding."
    ),
    "kinetic_energy": "Kinetic energy of all parts.",
    "elastic_energy": "Energy stored in stretching and bending.",
    "dissipated_power": "Power that damping removes, never negative.",
    "external_power": "Power of all loads and of heating, positive if they add energy.",
    "dissipated_energy": "Energy that damping has removed since the start.",
    "external_work": "Work of all loads and fields since the start, positive if they have added energy.",
    "energy_balance_error": (
        "Change of kinetic and elastic energy since the start, minus the work, plus the dissipated "
        "energy; zero in an exact solution."
    ),
    "smallest_tether_distance": "Smallest distance of a tip to another tether.",
    "auxiliary_tension": (
        "Mean axial force of a segment of the ring, from a tip to the next one; positive in tension."
    ),
    "deployed_length": "Length of the tether that is paid out, unstrained.",
    "payout_rate": "Rate of the deployed length; negative while the tether is reeled in.",
    "winch_tension": "Size of the force of the guide on the deployed tether.",
    "winch_power": "Power of the winch; positive when it adds energy to the sail.",
    "winch_work": "Work of all winches since the start.",
    "temperature": "Temperature of a tether.",
    "voltage": "Voltage that the law commands for a tether, positive for a positively charged tether.",
    "total_momentum_I": "Momentum of tethers, remote units, ring and hub in the frame I.",
    "angular_momentum_I": "Angular momentum about the centre of mass.",
    "total_angular_momentum_I": "Angular momentum about the origin of the frame I.",
    "hub_acceleration_B": (
        "What an accelerometer at the hub's centre shows: the acceleration of the centre less that of free "
        "fall, in B."
    ),
    "tip_direction_B": "Where a camera at the hub's centre sees a remote unit: a unit vector in B.",
    "spin_rate": (
        "Spin rates of two bodies: of the hub about X_B, and of the sail as a whole, its angular momentum "
        "over its moment of inertia about the axis of that momentum; positive in the right-handed sense."
    ),
    "electron_current": "Current of the electrons that a tether collects.",
    "electric_power": "Power that keeps all tethers at their voltages.",
    "heliocentric_position": "Position of the centre of the hub relative to the Sun.",
    "heliocentric_velocity": "Velocity of the centre of the hub relative to the Sun.",
    "orbital_elements": (
        "Semi-major axis, eccentricity, inclination, longitude of the ascending node, argument of the "
        "pericentre and true anomaly of the Kepler orbit that fits the position and velocity."
    ),
    "node_position_I": "Positions of the nodes of a tether, from its root to its tip.",
    "flat_sail_thrust_O": "Thrust that the formula for a flat sail gives for this attitude.",
    "flat_sail_thrust_moment_O": "Moment that the formula for a flat sail gives for this attitude.",
    "axisymmetric_thrust_O": (
        "Thrust that the formula for an axisymmetric sail gives for the mean shape of the tethers."
    ),
    "axisymmetric_thrust_moment_O": (
        "Moment that the formula for an axisymmetric sail gives for the mean shape of the tethers."
    ),
    "joint_position": "Positions of the joints, from the first to the tip of the last rod.",
    "tension": "Axial force of a rod, with that of damping; negative in compression.",
    "potential_energy": "Energy of gravity and of the field of the orbit; zero at the origin.",
    "energy_error": (
        "Change of the sum of kinetic, elastic and potential energy since the start, divided by the "
        "larger of its first magnitude and the largest kinetic energy."
    ),
}

COUNTED = (
    "thrust_O",
    "thrust_moment_O",
    "thrust_angle",
    "kinetic_energy",
    "elastic_energy",
    "dissipated_power",
    "external_power",
    "dissipated_energy",
    "external_work",
    "energy_balance_error",
    "smallest_tether_distance",
    "total_momentum_I",
    "angular_momentum_I",
    "total_angular_momentum_I",
    "spin_rate",
    "electric_power",
    "flat_sail_thrust_O",
    "flat_sail_thrust_moment_O",
    "axisymmetric_thrust_O",
    "axisymmetric_thrust_moment_O",
)
"""Observables of the whole sail in which a released tether counts as before: it flies on in the wind, at
the voltage that the law commands."""

LEFT_OUT = ("euler_sail", "precession_angle", "reaction_O", "reaction_moment_O", "reaction_angle")
"""Observables of the whole sail in which a released tether does not count: the plane of the tips, and the
forces at the roots."""

BY_HUB = ("coning_angle", "lagging_angle", "root_coning_angle", "root_lagging_angle")
"""Angles of a tether in axes of the hub, also when the tether is released."""

RELEASED = (
    dict.fromkeys(COUNTED, "A released tether still counts.")
    | dict.fromkeys(LEFT_OUT, "A released tether does not count.")
    | dict.fromkeys(
        BY_HUB, "For a released tether it is the angle of its free line, seen from its place on the hub."
    )
    | {
        "thrust_B": "A released tether keeps its thrust.",
        "thrust_moment_B": "A released tether keeps its thrust, with the moment about its free end.",
        "reaction_B": "Zero for a released tether.",
        "voltage": "The law commands a voltage for a released tether, too.",
        "electron_current": "A released tether collects electrons, too.",
    }
)
"""What becomes of an observable when a tether is released (`[[event]]`). An observable that is not named
goes on without a change."""

MEANINGS = {
    name: " ".join(filter(None, (first, RELEASED.get(name)))) for name, first in FIRST_SENTENCES.items()
}
"""The whole text of every observable."""
