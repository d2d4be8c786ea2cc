"""Rendering: the camera in the head, and images for people."""
