"""Guard of robot and agent: names faults and keeps commands within the motors' limit.

The monitors only use what the agent measures, sees and commands. While a fault is found the agent
learns nothing, and it takes back what it learned just before the fault was noticed.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from jmm_agent.guard.arm_state import ArmState
from jmm_agent.guard.camera_monitor import CameraMonitorOptions, FrozenCameraMonitor, HandMonitor
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
from jmm_agent.guard.recent import ROUNDING
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.observation import CONTROL_PERIOD, SensorReadings
from jmm_agent.types import Bools, Floats
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.hand_finder import FoundBy, FrameFinder, FrameJob, Hand, HandSeen

Gravity = Callable[[Floats], Floats]
"""Joint angles (n,) [rad] -> torques (n,) [N m] with which gravity bends the joints."""

FAR = 0.02
"""Correction of a joint angle from which on moment arms before and after it differ too much [rad].

Moment arms change by about as much of themselves."""


@dataclass(frozen=True)
class GuardOptions:
    """Frames that the guard uses, and the thresholds of all monitors.

    Attributes:
        hand: frame of the hand, on which external disturbances act.
        eye: frame of the camera.
        learned: number of marker observations that the map must have learned from before it is
            trusted. Until then its error may look like a push, or like a hidden marker while the
            hand moves. 0 for a map that is right from the start.
        history: how long estimates are kept, because frames arrive late [s].
        take_back: what was learned less than this before a fault was noticed is taken back [s].
        muscles: thresholds of the muscle monitor.
        delay: thresholds of the delay monitor.
        disturbance: thresholds of the disturbance monitor.
        camera: thresholds of the monitors of the camera and of the hand in its frames.
    """

    hand: str = "grip"
    eye: str = "eye"
    learned: int = 8
    history: float = 2.0
    take_back: float = 1.0
    muscles: MuscleMonitorOptions = field(default_factory=MuscleMonitorOptions)
    delay: DelayMonitorOptions = field(default_factory=DelayMonitorOptions)
    disturbance: DisturbanceMonitorOptions = field(default_factory=DisturbanceMonitorOptions)
    camera: CameraMonitorOptions = field(default_factory=CameraMonitorOptions)


class Guard:
    """All monitors of one robot.

    In each control step an `Agent` calls `filter` before it estimates the joint angles, `watch`
    after, and `limit` on its command.

    Args:
        muscles: names of the m muscles.
        kinematics: of the nominal model.
        camera: the camera that the frames come from.
        gravity: torques of gravity in the nominal model; None: no external disturbance is found.
        motors: how the motors turn commands into tensions, and their limit.
        options: thresholds.

    Attributes:
        faults: what is found now, in the order in which it was noticed.
        options: as given, or the defaults.
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
        self._names, self._used = tuple(muscles), np.ones(len(muscles), dtype=bool)
        self._delay = DelayMonitor(motors, options.delay)
        self._disturbance = DisturbanceMonitor(options.disturbance)
        self._camera = FrozenCameraMonitor(options.camera)
        self._hand = HandMonitor(camera, options.camera)
        self._found_by: FoundBy = "marker"
        self._filtered: FilteredReadings
        self.reset()

    @property
    def take_back(self) -> float:
        """What was learned less than this before a fault was noticed is taken back [s]."""
        return self.options.take_back

    def reset(self) -> None:
        """Forget the state of the robot, as at the start of an episode."""
        monitors = (self._muscles, self._delay, self._disturbance, self._camera, self._hand)
        for monitor in monitors:
            monitor.reset()
        self._estimates = deque[tuple[float, Floats]]()
        self._force_time, self._force_due = -np.inf, np.inf
        self.faults: list[Fault] = []

    def jump(self) -> None:
        """Forget earlier readings: those from before a jump of time cannot be compared."""
        self._muscles.jump()
        self._delay.jump()
        self._disturbance.jump()

    def set_stiffness(self, stiffness: Floats) -> None:
        """Take note that the motors have another stiffness from now on.

        Args:
            stiffness: K_stiff (m,) [N/m].
        """
        self._motors = motors = replace(self._motors, each=stiffness)
        self._muscles.motors = self._delay.motors = motors
        self._delay.jump()  # older commands demanded tensions at the stiffness of their time

    def leave_out(self, muscles: Bools) -> None:
        """Name no more faults of muscles that are out of use, from now on.

        What was found of others before they were out of use is forgotten.

        Args:
            muscles: which (m,).
        """
        self._muscles.forget(~self._used & ~muscles)
        self._used = ~muscles

    def map_changed(self) -> None:
        """Forget earlier estimates: those of another map cannot be compared with the next ones."""
        self._estimates.clear()
        self._camera.forget_estimate()
        self._hand.forget_estimate()

    def filter(
        self, readings: SensorReadings, after: float, command: Floats, expected: Floats
    ) -> FilteredReadings:
        """Readings of which each can be used, and which of them are in doubt.

        Args:
            readings: of this control step; some may be not finite.
            after: time of the readings before [s]; -inf for the first.
            command: target lengths (m,) [m] while they were measured.
            expected: muscle lengths (m,) [m] by the map at the estimate.

        Raises:
            AgentError: the readings are of the wrong shape or not later, or no length is finite.
        """
        readings = readings.checked(after, len(command), gaps=True)
        dt = readings.time - after if np.isfinite(after) else CONTROL_PERIOD
        lengths, tensions = readings.lengths, readings.tensions
        filtered = self._muscles.update(dt, lengths, tensions, command, expected)
        if not self._used.all():
            doubts = (doubt & self._used for doubt in filtered[2:])
            filtered = FilteredReadings(filtered.lengths, filtered.tensions, *doubts)
        usable = ~(filtered.doubted | filtered.numb) & self._used
        self._delay.update(dt, filtered.lengths, filtered.tensions, command, usable)
        self._filtered = filtered
        return filtered

    def watch(self, readings: SensorReadings, state: ArmState) -> bool:
        """Bring ``faults`` up to date after the estimation.

        Args:
            readings: of this control step, filtered.
            state: what the agent knows of the arm.

        Returns:
            Whether a fault is new.

        Raises:
            AgentError: the frame has a wrong shape or type.
        """
        trusted = state.observations >= self.options.learned
        if state.hand_is_free:
            self._watch_hand(readings.time, state, trusted)
        else:
            self._disturbance.reset()
        if state.finder is not None:
            self._found_by = state.finder.what
            self._watch_camera(readings, state.q, state.finder, trusted)
        return self._update_faults(readings.time)

    def limit(self, target_lengths: Floats) -> Floats:
        """Target lengths (m,) [m] that demand no tension above the motors' limit.

        Snapped muscles, and those whose encoder is not believed, are left at T_bias.
        """
        filtered = self._filtered
        shortest = self._motors.shortest_target(filtered.lengths)
        return np.maximum(target_lengths, np.where(filtered.unsafe, filtered.lengths, shortest))

    def _watch_hand(self, time: float, state: ArmState, trusted: bool) -> None:
        """Estimate the external force on the hand, if neither muscles nor moment arms are in doubt.

        The estimator has computed moment arms shortly before the estimate.
        """
        estimate = state.q
        self._estimates.append((time, estimate))
        while time - self._estimates[0][0] > self.options.history:
            self._estimates.popleft()
        every = self.options.disturbance.every
        self._force_due = min(self._force_due, time + every / 2.0)
        if time < self._force_due - ROUNDING:
            return
        self._force_due += every
        if self._force_due <= time:  # fewer steps than estimates were due
            self._force_due = time + every / 2.0
        in_doubt = (self._filtered.doubted | self._filtered.numb).any()
        far = np.abs(estimate - state.jacobian_at).max() > FAR
        if self._gravity is None or in_doubt or far:
            return
        torques = self._gravity(estimate) - state.jacobian.T @ (
            self._filtered.tensions * self._used
        )
        jacobian = self._kinematics.frame_jacobian(self.options.hand, estimate)[:3]
        rotation = self._kinematics.pose(self.options.hand, estimate)[:3, :3]
        self._disturbance.update(time - self._force_time, torques, jacobian, rotation, trusted)
        self._force_time = time

    def _watch_camera(
        self, readings: SensorReadings, q: Floats, finder: FrameFinder, trusted: bool
    ) -> None:
        """Compare a new frame with the one before and with what the estimate predicts."""
        frame, frame_time = readings.frame, readings.frame_time
        if self._camera.is_new(readings.time, frame_time) and frame is not None:
            exposed = self._estimate_at(frame_time)
            finder.submit(FrameJob(frame_time, frame, q, self._filtered.lengths, exposed))
        for job, hand in finder.results():
            self._compare(job, hand, finder, trusted)

    def _compare(self, job: FrameJob, hand: Hand, finder: FrameFinder, trusted: bool) -> None:
        """Compare the hand in a frame with the frame before and with the expected pose."""
        estimate = self._estimate_at(job.time)
        eye = None if estimate is None else self._kinematics.pose(self.options.eye, estimate)
        rotation = None if eye is None else eye[:3, :3]
        in_view = isinstance(hand, HandSeen)
        if not self._camera.is_another(job.frame, job.lengths, in_view, rotation):
            return
        predicted = None if estimate is None else finder.pose(estimate)
        self._hand.update(job.time, hand, predicted, trusted, finder.around)

    def _estimate_at(self, time: float) -> Floats | None:
        """Estimated joint angles (n,) [rad] at a time [s]; None from before the history.

        Between two steps it is interpolated.
        """
        estimates = self._estimates
        if not estimates or time < estimates[0][0] - ROUNDING:
            return None
        after = bisect_left(estimates, time - ROUNDING, key=lambda entry: entry[0])
        if after == len(estimates) or estimates[after][0] <= time + ROUNDING:
            return estimates[min(after, len(estimates) - 1)][1]
        (begin, before), (end, later) = estimates[after - 1], estimates[after]
        return before + (time - begin) / (end - begin) * (later - before)

    def _update_faults(self, time: float) -> bool:
        """Bring ``faults`` up to date; whether one is new."""
        known = {(fault.kind, fault.where): fault for fault in self.faults}
        found = list(self._found())
        self.faults = [known.get((kind, where), Fault(kind, where, time)) for kind, where in found]
        self.faults.sort(key=lambda fault: fault.since)
        return any(fault not in known for fault in found)

    def _found(self) -> Iterator[tuple[str, str]]:
        """Kind and location of each fault that is found now."""
        for kind, muscle in self._muscles.found():
            if self._used[self._names.index(muscle)]:
                yield kind, muscle
        if self._delay.late:
            yield COMMAND_LATE, "commands"
        if self._disturbance.pushed:
            yield PUSHED, "hand"
        if self._camera.frozen:
            yield CAMERA_FROZEN, "camera"
        for kind in self._hand.found(self._found_by):
            yield kind, self._found_by
