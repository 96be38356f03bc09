"""What one sees: the Rerun recording, its blueprint, and the viewer process."""
