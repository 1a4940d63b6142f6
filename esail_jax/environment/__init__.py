"""Where a sail is: wind, laws of thrust, orbits, temperature of wires."""
