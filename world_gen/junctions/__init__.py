"""Where roads meet: junctions as a driver sees them, found in the road graph."""
