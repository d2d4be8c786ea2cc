"""Agents that know the nominal model of a robot: of Kengoro's arm, or of one's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np

from jmm_agent.agent import Agent
from jmm_agent.commissioning.commissioning import Commissioning
from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import MotorControl
from jmm_agent.guard.guard import Guard, GuardOptions
from jmm_agent.heat.heat_monitor import HeatMonitor
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Rule
from jmm_agent.muscle_order import MuscleOrder
from jmm_agent.options import AgentOptions
from jmm_agent.scales import RobotScales, robot_scales
from jmm_agent.types import Floats
from jmm_agent.updaters import VisionOptions
from jmm_agent.updaters.vision_options import HandKind
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.can_finder import CanFinder
from jmm_agent.vision.can_shape import CanKind, CanShape
from jmm_agent.vision.hand_detection import HandDetector
from jmm_agent.vision.hold_out import HoldOutOptions
from jmm_agent.vision.marker_detector import Detector, MarkerDetector
from kengoro.errors import UsageError
from kengoro.hand_search import READY
from kengoro.hand_weights import trained_hand
from kengoro.nominal_robot import NominalRobot
from kengoro.robots import SIDES, arm_scene, check_seed, sample_within
from kengoro.trained_maps import map_of, points_of
from kengoro_env.postures import posture_set

__all__ = ["make_agent", "scales_of"]


class _Design(NamedTuple):
    """What an agent knows of its robot: what is given, the rest by the nominal model."""

    robot: NominalRobot
    kinematics: ArmKinematics
    camera: Camera
    motors: MotorControl
    scales: RobotScales
    options: AgentOptions


def make_agent(
    seed: int = 0,
    *,
    guard: bool = False,
    scene: Path | str | None = None,
    folders: Sequence[Path | str] = (),
    camera: Camera | None = None,
    marker_sides: Mapping[int, float] = SIDES,
    postures: Floats | None = None,
    start: Floats | None = None,
    jmm: JointMuscleMap | None = None,
    dictionary: str = "DICT_4X4_50",
    detector: Detector | None = None,
    hand: HandKind | Path | HandDetector | None = None,
    can: CanKind | CanShape | None = None,
    motors: MotorControl | None = None,
    scales: RobotScales | None = None,
    options: AgentOptions | None = None,
    guard_options: GuardOptions | None = None,
    rule: Rule | None = None,
    learning: bool = True,
    cache: Path | None = None,
    commissioning: Commissioning | None = None,
) -> Agent:
    """An agent that knows the nominal model of a robot, by default Kengoro's arm, and no more.

    Args:
        seed: of the rehearsal pairs that learning samples.
        guard: whether faults are named and not learned; without ``options``, updates are tested.
        scene: MJCF file of another robot's nominal model; Kengoro's arm if left out.
        folders: further folders whose files the model may include or load.
        camera: the camera model that the agent uses; that of the MJCF file if left out.
        marker_sides: side of each marker [m] by its id in the dictionary.
        postures: typical ones, shape (N, n) [rad], for the scale of the prior; samples if left out.
        start: joint angles at which the agent believes to start, shape (n,) [rad].
        jmm: the map to begin with; that of the nominal model if left out, trained once and kept.
        dictionary: name of the markers' dictionary in OpenCV, see `MarkerDetector`.
        detector: finds markers in frames; a `MarkerDetector` if left out.
        hand: "marker", "seen", or a detector that sees it or its file; by ``options`` if left out.
        can: "marker", "seen", or the shape of a can that is seen; by ``options`` if left out.
        motors: gains and limit; those of the MJCF file, or by its load, if left out.
        scales: of the robot; by its nominal model if left out.
        options: of the agent; they name its camera and markers, too. Others derive from the model.
        guard_options: of the guard; they name the frame on which disturbances act.
        rule: how the map is moved by what is learned; the ridge rule if left out.
        learning: whether the agent learns; see `Agent.learning`.
        cache: folder of trained maps; the user's cache folder if left out.
        commissioning: result of a run, which is undone; absent muscles are left out.

    Raises:
        UsageError: an argument is not valid, or the model has no such camera or marker.
        CommissioningError: a fault of the run cannot be undone.
    """
    options, sees = _chosen(options, guard, hand, can, _is_own(scene, seed), camera)
    design = _design(scene, folders, camera, marker_sides, motors, options, scales, jmm)
    design, jmm = _mapped(design, scene, folders, jmm, cache, commissioning)
    posed = _postures(design.robot, jmm.joints, scene is not None, postures, start)
    given = detector or _detector(design, marker_sides, dictionary)
    agent = _made(design, jmm, given, posed, seed, rule, _known(design, jmm, cache, sees))
    return _equipped(agent, design, learning, commissioning, guard, guard_options)


def _is_own(scene: Path | str | None, seed: int) -> bool:
    """Whether the robot is one's own; checks the seed, too."""
    check_seed(seed)
    return scene is not None


def _made(
    design: _Design,
    jmm: JointMuscleMap,
    detector: Detector | None,
    posed: tuple[Floats, Floats],
    seed: int,
    rule: Rule | None,
    known: dict[str, Any],
) -> Agent:
    """The agent, before it is equipped."""
    rng, options = np.random.default_rng([seed, 2]), design.options
    return Agent(jmm, design.kinematics, detector, *posed, rng, options, rule, **known)


def _known(
    design: _Design, jmm: JointMuscleMap, cache: Path | None, hand: HandDetector | None
) -> dict[str, Any]:
    """What is known of loads, of points of attachment, and of the shapes of hand and can."""
    points, options = points_of(jmm, design.robot.model, cache), design.options
    sees = options.can == "seen" and options.camera
    can = CanFinder(design.camera, options.can_shape) if sees else None
    return {"loads": design.robot.arm, "points": points, "hand": hand, "can": can}


def _order(commissioning: Commissioning | None) -> MuscleOrder | None:
    """Order of the muscles, if it is not that of the model."""
    order = None if commissioning is None else commissioning.order
    return order if order is not None and order.changes else None


def _equipped(
    agent: Agent,
    design: _Design,
    learning: bool,
    commissioning: Commissioning | None,
    guard: bool,
    options: GuardOptions | None,
) -> Agent:
    """The agent with its guard, and what it knows of the robot's motors and muscles."""
    agent.guard = _guard(design, agent.map, options) if guard else agent.guard
    agent.statics, agent.motors = design.robot.statics(design.motors), design.motors
    agent.learning, agent.order = learning, _order(commissioning)
    agent.heat = _heat(design, agent.map, agent.options)
    return agent


def _mapped(
    design: _Design,
    scene: Path | str | None,
    folders: Sequence[Path | str],
    jmm: JointMuscleMap | None,
    cache: Path | None,
    commissioning: Commissioning | None,
) -> tuple[_Design, JointMuscleMap]:
    """Design and map of a robot without muscles that are absent; gains and scales stay.

    Raises:
        UsageError: no muscle would move some joint.
    """
    jmm = map_of(design.robot.model, cache) if jmm is None else jmm
    without = () if commissioning is None else commissioning.absent
    if not without:
        return design, jmm
    try:
        robot = NominalRobot(arm_scene() if scene is None else scene, folders, None, without)
    except AgentError as error:
        raise UsageError(
            f"Without {', '.join(without)} the robot cannot be used: {error}"
        ) from error
    missing = [name for name in without if name in jmm.muscles]
    return design._replace(robot=robot), jmm.without(missing)


def _detector(
    design: _Design, marker_sides: Mapping[int, float], dictionary: str
) -> Detector | None:
    """Detector of the markers; None if there is no camera, or no marker on what is not seen."""
    options = design.options
    gone = {options.hand_marker} if options.vision.hand == "seen" else set()
    gone |= {options.can_marker} if options.can == "seen" else set()
    marker_sides = {one: side for one, side in marker_sides.items() if one not in gone}
    if not options.camera or not (marker_sides or options.vision.hand == "marker"):
        return None
    return MarkerDetector(design.camera, marker_sides, dictionary)


def _chosen(
    options: AgentOptions | None,
    guard: bool,
    hand: HandKind | Path | HandDetector | None,
    can: CanKind | CanShape | None,
    own: bool,
    camera: Camera | None,
) -> tuple[AgentOptions, HandDetector | None]:
    """Options before they are scaled, and what finds the hand if it is seen without a marker.

    A robot of one's own may have no marker's site: the frame of the hand is used in its stead.
    """
    if guard and options is None:
        options = AgentOptions(vision=VisionOptions(hold_out=HoldOutOptions()))
    options = _with_can(options or AgentOptions(), can)
    if hand is not None:
        kind: HandKind = hand if isinstance(hand, str) else "seen"
        if kind not in get_args(HandKind):
            raise UsageError(
                f"The hand is {kind!r}, but it must be 'marker' or 'seen'; the file of a detector "
                f"is given as a Path: hand=Path({kind!r})."
            )
        options = replace(options, vision=replace(options.vision, hand=kind))
    if hand is None or isinstance(hand, str | Path):
        path = hand if isinstance(hand, Path) else None
        sees = trained_hand(options, own, camera, path)
    elif isinstance(hand, type) or not all(hasattr(hand, n) for n in ("frame", "detect", "shows")):
        raise UsageError(
            f"hand is {hand!r}, but must be 'marker', 'seen', the Path of a file of `kengoro "
            "hand-detector`, or a detector with frame, detect and shows."
        )
    else:
        sees = hand
    if own and sees is not None and options.marker_site == AgentOptions().marker_site:
        options = replace(options, marker_site=sees.frame)
    return options, sees


def _with_can(options: AgentOptions, can: CanKind | CanShape | None) -> AgentOptions:
    """Options with this can, if one is given."""
    if can is None:
        return options
    if isinstance(can, CanShape):
        return replace(options, can="seen", can_shape=can)
    if not isinstance(can, str) or can not in get_args(CanKind):
        raise UsageError(
            f"can is {can!r}, but must be 'marker', 'seen', or the jmm_agent.CanShape of a can "
            "that is seen."
        )
    return replace(options, can=can)


def _design(
    scene: Path | str | None,
    folders: Sequence[Path | str],
    camera: Camera | None,
    marker_sides: Mapping[int, float],
    motors: MotorControl | None,
    options: AgentOptions,
    scales: RobotScales | None = None,
    jmm: JointMuscleMap | None = None,
) -> _Design:
    """What an agent knows of its robot; names are checked before a map is trained."""
    _check_types(camera=camera, marker_sides=marker_sides, motors=motors, scales=scales)
    robot = NominalRobot(arm_scene() if scene is None else scene, folders)
    kinematics = robot.kinematics(robot.arm.joints if jmm is None else jmm.joints, options)
    camera = robot.camera(options.camera) if camera is None else camera
    motors = robot.motors() if motors is None else motors
    if scales is None:
        scales = _scales(robot, kinematics, camera, marker_sides, motors, options)
    return _Design(robot, kinematics, camera, motors, scales, scales.agent_options(options))


def _check_types(**given: object) -> None:
    """Refuse arguments of another type."""
    types = {
        "camera": Camera,
        "marker_sides": Mapping,
        "motors": MotorControl,
        "scales": RobotScales,
    }
    for name, value in given.items():
        if value is not None and not isinstance(value, types[name]):
            hint = ""
            if name == "camera":
                hint = "; AgentOptions(camera=...) names a camera of the model"
            raise UsageError(f"{name} is {value!r}, but must be a {types[name].__name__}{hint}.")


def _postures(
    robot: NominalRobot,
    joints: Sequence[str],
    own: bool,
    typical: Floats | None,
    start: Floats | None,
) -> tuple[Floats, Floats]:
    """Typical postures (N, n) [rad] and the first one (n,) [rad]: those given, or samples."""
    if typical is None:
        typical = sample_within(robot.arm, 100) if own else posture_set()
    else:
        typical = _angles("postures", typical, len(joints), 2)
    if start is None:
        return typical, typical[0] if own else np.array(READY)
    return typical, _angles("start", start, len(joints), 1)


def _angles(name: str, given: object, joints: int, dimensions: int) -> Floats:
    """An argument as finite angles [rad] of shape (n,) or (N, n)."""
    try:
        angles = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        angles = np.array(np.nan)
    fits = angles.ndim == dimensions and angles.shape[-1] == joints and angles.size > 0
    if not fits or not np.isfinite(angles).all():
        shape = f"({joints},)" if dimensions == 1 else f"(N, {joints})"
        raise UsageError(
            f"{name} must be finite angles [rad] of shape {shape}; got shape {angles.shape}."
        )
    return angles


def _heat(design: _Design, jmm: JointMuscleMap, options: AgentOptions) -> HeatMonitor | None:
    """Monitor of the motors' heat; None if the options do not ask for one."""
    heat = options.heat
    return None if heat is None else HeatMonitor(jmm.muscles, design.motors, heat)


def _guard(design: _Design, jmm: JointMuscleMap, given: GuardOptions | None) -> Guard:
    named = design.scales.guard_options(_named(given, design.kinematics, design.options))
    gravity = design.robot.arm.gravity
    return Guard(jmm.muscles, design.kinematics, design.camera, gravity, design.motors, named)


def scales_of(
    scene: Path | str | None = None,
    folders: Sequence[Path | str] = (),
    camera: Camera | None = None,
    marker_sides: Mapping[int, float] = SIDES,
    motors: MotorControl | None = None,
    options: AgentOptions | None = None,
) -> RobotScales:
    """Scales of a robot, from which `make_agent` derives all options.

    Args:
        scene: MJCF file of the robot's nominal model; Kengoro's arm if left out.
        folders: further folders whose files the model may include or load.
        camera: the camera model that the agent uses; that of the MJCF file if left out.
        marker_sides: side of each marker [m] by its id.
        motors: gains and limit of the motors; those of the MJCF file, or by its load, if left out.
        options: name camera and marker.

    Raises:
        UsageError: an argument has the wrong type, or the model has no such camera or marker.
    """
    options = options or AgentOptions()
    return _design(scene, folders, camera, marker_sides, motors, options).scales


def _scales(
    robot: NominalRobot,
    kinematics: ArmKinematics,
    camera: Camera,
    marker_sides: Mapping[int, float],
    motors: MotorControl,
    options: AgentOptions,
) -> RobotScales:
    by_marker = options.vision.hand == "marker"
    if options.camera and by_marker and options.hand_marker not in marker_sides:
        known = ", ".join(str(number) for number in marker_sides) or "none"
        raise UsageError(
            f"The hand's marker has the id {options.hand_marker}, but marker_sides has no side of "
            f"it; it has: {known}."
        )
    side = marker_sides.get(options.hand_marker, RobotScales.marker_side)
    return robot_scales(robot.model, kinematics, camera, side, motors, options)


def _named(
    given: GuardOptions | None, kinematics: ArmKinematics, options: AgentOptions
) -> GuardOptions:
    """Options of the guard with the agent's camera, and the marker where there is no grip."""
    given, default = given or GuardOptions(), GuardOptions()
    eye = options.camera if given.eye == default.eye else given.eye
    hand = given.hand
    if hand == default.hand and hand not in kinematics.frames:
        hand = options.marker_site
    return replace(given, hand=hand, eye=eye)
