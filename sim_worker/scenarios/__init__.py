"""Scenarios: their files, their cases, and where on a World's junctions they take place."""
