"""Sensors that do not exist: what a lidar on the car would measure in a World and its traffic."""
