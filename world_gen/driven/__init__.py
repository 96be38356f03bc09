"""Lanes where the car's own passes say they are, instead of where the map has them."""
