"""What pushes: thrust of the wind with its voltages, fields of acceleration, and the laws and terms of
users."""
