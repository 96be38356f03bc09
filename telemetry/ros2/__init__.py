"""ROS 2 without ROS: the keys, attachments and tokens of rmw_zenoh and zenoh-bridge-ros2dds."""
