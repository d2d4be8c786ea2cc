"""Reference driver: an agent drives a robot in another process, through a socket.

`client.RemoteRobot` is the driver in the process of the agent, `server.RobotServer` serves a robot
beside its motors, with a watchdog. `process.robot_process` starts a simulated robot.
"""
