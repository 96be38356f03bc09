"""Metrics, one small file per topic."""
