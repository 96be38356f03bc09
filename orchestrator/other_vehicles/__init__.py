"""Vehicles beside the car: where their telemetry comes from, and what becomes of it."""
