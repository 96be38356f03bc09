"""Messages of ROS 1 and ROS 2, and what they mean here."""
