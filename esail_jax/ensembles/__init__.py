"""Ensembles: one scene simulated for many sets of numbers, and what the results say together."""
