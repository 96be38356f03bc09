"""The rules of junctions: stop lines, signs, lights, and right of way."""
