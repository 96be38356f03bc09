"""The vehicle's state from what it sends: pure and causal."""
