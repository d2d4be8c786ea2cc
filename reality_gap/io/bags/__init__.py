"""Bags: reading of ROS 1 and ROS 2 bags, MCAP files and LeRobot datasets, one file a format."""
