"""A map as OpenStreetMap has it: read whole, or clipped from an index on disk."""
