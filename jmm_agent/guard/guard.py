"""Watches over robot and agent: names faults, and keeps commands within the motors' limit.

The watchers only use what the agent feels, sees and commands. While anything is found the agent
learns nothing, and it takes back what it learned just before that was noticed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from jmm_agent.guard.camera_monitor import CameraMonitorOptions, FrozenCameraMonitor, MarkerMonitor
from jmm_agent.guard.faults import (
    CAMERA_FROZEN,
    COMMAND_LATE,
    PUSHED,
    Fault,
    MotorControl,
)
from jmm_agent.guard.motion_monitor import (
    DelayMonitor,
    DelayMonitorOptions,
    DisturbanceMonitor,
    DisturbanceMonitorOptions,
)
from jmm_agent.guard.muscle_monitor import FilteredReadings, MuscleMonitor, MuscleMonitorOptions
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.marker_detector import MarkerPose, Skip

Gravity = Callable[[Floats], Floats]
"""Joint angles (n,) [rad] -> torques (n,) [N m] with which gravity bends the joints."""


@dataclass(frozen=True)
class GuardOptions:
    """What the guard looks at, and the thresholds of all watchers.

    Attributes:
        hand: the frame that may be pushed.
        eye: that of the camera.
        learned: so many looks must be remembered before the map is trusted: before that it may be
            wrong by as much as a push would have it, or a marker that is hidden as the hand moves.
            0 for a map that is right from the start.
        history: for how long estimates are kept, since frames come late [s].
        take_back: what was learned for so long before a fault was noticed is taken back [s].
        wires, late, push, sight: of the watchers.
    """

    hand: str = "grip"
    eye: str = "eye"
    learned: int = 8
    history: float = 2.0
    take_back: float = 1.0
    muscles: MuscleMonitorOptions = field(default_factory=MuscleMonitorOptions)
    late: DelayMonitorOptions = field(default_factory=DelayMonitorOptions)
    push: DisturbanceMonitorOptions = field(default_factory=DisturbanceMonitorOptions)
    sight: CameraMonitorOptions = field(default_factory=CameraMonitorOptions)


class Guard:
    """All watchers of one robot; an `Agent` calls it at each step.

    Args:
        muscles: names of the m muscles.
        kinematics: of the arm as drawn.
        camera: that the frames come from.
        gravity: of the arm as drawn; None: pushes are not looked for.
        motors: how the motors turn commands into tensions, and their limit.
        options: thresholds.

    Attributes:
        faults: what is found now, in the order in which it was noticed.
    """

    def __init__(
        self,
        muscles: tuple[str, ...],
        kinematics: ArmKinematics,
        camera: Camera,
        gravity: Gravity | None = None,
        motors: MotorControl | None = None,
        options: GuardOptions | None = None,
    ) -> None:
        self.options = options = options or GuardOptions()
        self._kinematics, self._gravity = kinematics, gravity
        self._motors = motors = motors or MotorControl()
        self._muscles = MuscleMonitor(muscles, motors, options.muscles)
        self._late = DelayMonitor(motors, options.late)
        self._push = DisturbanceMonitor(options.push)
        self._camera = FrozenCameraMonitor(options.sight)
        self._marker = MarkerMonitor(camera, options.sight)
        self._felt: FilteredReadings
        self.reset()

    def reset(self) -> None:
        """Forget the robot's state, as at the start of an episode."""
        for watch in (self._muscles, self._late, self._push, self._camera, self._marker):
            watch.reset()
        self._estimates = deque[tuple[float, Floats]]()
        self._steps, self._force_time = 0, -np.inf
        self.trust(0)
        self.faults: list[Fault] = []

    def map_changed(self) -> None:
        """Estimates of another map are not comparable with those before."""
        self._estimates.clear()
        self._camera.forget_estimate()
        self._marker.forget_estimate()

    def feel(
        self, period: float, lengths: Floats, tensions: Floats, command: Floats, expected: Floats
    ) -> FilteredReadings:
        """What can be used of the readings; see `MuscleMonitor.update`."""
        self._felt = felt = self._muscles.update(period, lengths, tensions, command, expected)
        self._late.update(felt.lengths, felt.tensions, command, ~(felt.doubted | felt.numb))
        return felt

    def trust(self, observations: int) -> None:
        """Trust the map if enough looks are remembered that it learned from."""
        self._trusted = observations >= self.options.learned

    def watch_hand(self, time: float, estimate: Floats, map_jacobian: Callable[[], Floats]) -> None:
        """Look for a push, where all wires can be believed.

        Args:
            time: now [s].
            estimate: joint angles (n,) [rad].
            map_jacobian: gives moment arms (m, n) [m/rad] at the estimate.
        """
        self._estimates.append((time, estimate))
        while time - self._estimates[0][0] > self.options.history:
            self._estimates.popleft()
        self._steps += 1
        every = self.options.push.every
        doubtful = (self._felt.doubted | self._felt.numb).any()
        if self._gravity is None or self._steps % every or doubtful:
            return
        torques = self._gravity(estimate) - map_jacobian().T @ self._felt.tensions
        jacobian = self._kinematics.frame_jacobian(self.options.hand, estimate)[:3]
        rotation = self._kinematics.pose(self.options.hand, estimate)[:3, :3]
        self._push.update(time - self._force_time, torques, jacobian, rotation, self._trusted)
        self._force_time = time

    def leave_hand(self) -> None:
        """The hand holds something: what pushes it now is no fault."""
        self._push.reset()

    def watch_camera(
        self,
        time: float,
        frame: np.ndarray | None,
        frame_time: float,
        detect: Callable[[np.ndarray], MarkerPose | Skip],
        believe: Callable[[Floats], Floats],
    ) -> None:
        """Look at a frame if it is new.

        Args:
            time: now [s].
            frame: newest frame (H, W, 3) uint8, or None.
            frame_time: when it was taken [s].
            detect: finds the hand's marker in a frame.
            believe: pose_marker_in_camera (4, 4) at joint angles (n,) [rad].
        """
        if not self._camera.is_new(time, frame_time) or frame is None:
            return
        outcome = detect(frame)
        in_view = isinstance(outcome, MarkerPose)
        estimate = self._estimate_at(frame_time)
        eye = None if estimate is None else self._kinematics.pose(self.options.eye, estimate)
        rotation = None if eye is None else eye[:3, :3]
        if not self._camera.is_another(frame, self._felt.lengths, in_view, rotation):
            return
        believed = None if estimate is None else believe(estimate)
        self._marker.update(frame_time, outcome, believed, self._trusted)

    def _estimate_at(self, time: float) -> Floats | None:
        """Joint angles (n,) [rad] as estimated at a time [s]; None from before the history."""
        past = [estimate for at, estimate in self._estimates if at <= time + 1e-9]
        return past[-1] if past else None

    def judge(self, time: float) -> bool:
        """Bring ``faults`` up to date; whether one is new."""
        known = {(fault.kind, fault.where): fault for fault in self.faults}
        found = list(self._found())
        self.faults = [known.get((kind, where), Fault(kind, where, time)) for kind, where in found]
        self.faults.sort(key=lambda fault: fault.since)
        return any(fault not in known for fault in found)

    def _found(self) -> Iterator[tuple[str, str]]:
        yield from self._muscles.found()
        if self._late.late:
            yield COMMAND_LATE, "commands"
        if self._push.pushed:
            yield PUSHED, "hand"
        if self._camera.frozen:
            yield CAMERA_FROZEN, "camera"
        for kind in self._marker.found():
            yield kind, "marker"

    def safe(self, target_lengths: Floats) -> Floats:
        """Target lengths (m,) [m] that demand no tension above the limit.

        Wires whose encoder cannot be believed, and those that snapped, are left at T_bias.
        """
        felt = self._felt
        least = np.where(felt.unsafe, felt.lengths, self._motors.shortest_target(felt.lengths))
        return np.maximum(target_lengths, least)
