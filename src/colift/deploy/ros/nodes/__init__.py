"""The nodes: `node` is what all share, every other file is one of them, with the ROS side of what it does."""
