"""Exports of a World, one file per format."""
