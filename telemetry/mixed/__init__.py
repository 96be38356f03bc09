"""What is really around the car and what only the simulation holds, as one surrounding."""
