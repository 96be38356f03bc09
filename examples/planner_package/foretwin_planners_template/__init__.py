"""Planners under test for foretwin."""
