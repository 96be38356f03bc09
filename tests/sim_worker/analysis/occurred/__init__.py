"""Drives that were staged, and drives of real cars, against what is recognised in them."""
