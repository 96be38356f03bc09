"""The co-pilot display: a page beside Rerun that is read in one second, in a moving car."""
