"""Certificates of a campaign."""
