"""Connections through junctions: legal movements, their lanes and their paths."""
