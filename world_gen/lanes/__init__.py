"""Lanes: cross-sections from tags, and curves cut where junctions begin."""
