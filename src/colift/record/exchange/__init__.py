"""Formats in which flights and messages are exchanged with other programs: ROS 2 topics, and bags of them."""
