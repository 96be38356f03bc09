"""Plane geometry: polylines, Frenet paths, arcs and turns, rectangles, convex cuts."""
