"""Planners under test, found by entry point."""
