"""The stand-in car on a lot as a stack under test: over ROS 2, it brakes for whom it hears of."""
