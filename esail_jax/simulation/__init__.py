"""The run of a scene: from its tables to a solution."""
