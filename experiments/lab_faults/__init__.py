"""Processes that are killed and lines that break: who stops the robot, and how soon."""
