"""The control loop between an agent and a robot, and what stops the robot when it fails."""
