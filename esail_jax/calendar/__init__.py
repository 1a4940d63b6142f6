"""Dates: what connects the seconds of a run with the calendar."""
