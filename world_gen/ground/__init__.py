"""What lies on the ground: pavement, kerbs, islands, sidewalks, crossings."""
