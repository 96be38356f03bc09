"""From map to intersections to Worlds to exports; a pure library without bus or processes."""
