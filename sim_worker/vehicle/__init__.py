"""The planar vehicle model and its parameters."""
