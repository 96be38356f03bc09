"""The way ahead: roads, routes, the line a car drives on them, and where on it the car is."""
