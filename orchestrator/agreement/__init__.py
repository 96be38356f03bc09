"""Judging: human beside software, simulation against reality, a recorded drive once more."""
