"""The rules of junctions: stop lines, signs, lights, and who waits for whom."""
