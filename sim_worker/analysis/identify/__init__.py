"""Identification: what a stretch of driving says of the vehicle's parameters, and how surely."""
