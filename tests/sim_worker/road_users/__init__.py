"""Tests of other road users."""
