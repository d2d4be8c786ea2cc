"""Wire snaps: a muscle snaps in motion, and the robot moves on with the others."""
