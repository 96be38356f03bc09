"""Vehicle model, futures, twin, shadow and ghost, metrics, and the worker process."""
