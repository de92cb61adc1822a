"""A team's controllers, and its simulation, as ROS 2 nodes.

What a node does is in a file without ROS, which tests call by itself: `allocating`, `steering`, `simulating`. `nodes` gives each its
topics (:mod:`colift.record.exchange.topics`); `node` is what they share.
"""
