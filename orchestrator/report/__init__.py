"""Runs and sweeps as one HTML file that opens anywhere: what was foreseen, what came, the proof."""
