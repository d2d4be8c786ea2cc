"""A policy that grasps on the drawing, from demonstrations or from the reward alone."""
