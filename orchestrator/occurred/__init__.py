"""What really occurred in a run's drive, read from its folder."""
