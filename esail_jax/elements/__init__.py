"""What has mass and stiffness: cables and trusses, hub, ring, hinges, and their energies and
dissipations."""
