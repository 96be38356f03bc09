"""Readers of recorded drives, one file per format."""
