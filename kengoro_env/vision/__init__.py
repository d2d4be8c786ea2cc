"""What is drawn of a robot: the camera in its head, and pictures for people."""
