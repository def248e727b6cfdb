"""Recorded flights again: decided anew and compared, or played back by time."""
