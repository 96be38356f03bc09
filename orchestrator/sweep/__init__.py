"""Scenario sweeps offline: what is swept, where, by which workers, and the rows that come of it."""
