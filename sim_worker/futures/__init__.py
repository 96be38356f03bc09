"""Futures of the car: from a job over its scene and closed loop to outcomes."""
