"""Route ahead, mission, supervision, results, configuration, and the command line."""
