"""What somebody who watches a session is shown: the scene with marks, and curves of the errors.

Nothing here opens a window (`kengoro.viewer.window` does), and nothing changes the session: the
scene is a copy of the robot's model and state, and kinematics are computed anew.
"""

from __future__ import annotations

from functools import cache, partial
from typing import NamedTuple

import mujoco
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.types import Floats
from kengoro.session import Session
from kengoro.trained_maps import ARM
from kengoro.visits import grip
from kengoro_env.assets import asset_path
from kengoro_env.env import OUTSIDE
from kengoro_env.names import JOINTS
from kengoro_env.robot.tendons import spool_joint
from kengoro_env.vision.rendering import HEIGHT, WIDTH, Image, Painter

NOTE_PERIOD = 0.1
"""Time between two points of the curves [s of the robot's time]."""

MOST_POINTS = 600
"""Points of a curve that are drawn at most."""

FULL_TENSION = 300.0
"""Tension of the last colour of the wires [N]; higher ones have it, too."""

MUSCLE_COLOURS = "autumn_r"
MUSCLE_WIDTH = 0.003
"""Radius of the wires as shown [m]; twice the true one, so that colours are seen."""

SEEN, BELIEVED = "#00a02c", "#1452ff"
"""Colours of the hand's marker: as the camera saw it, and where the agent believes it to be."""

MARK_SIZE = 0.016
"""Half the width of such a mark [m]."""

VIEW_DISTANCE = 1.4
"""From the camera outside to the robot, about which a moved view turns [m]."""

PANEL_SIZE = (4.6, 6.0)
PANEL_DPI = 100
"""Of the picture with legend and curves: width and height [inches], and pixels an inch."""


class Marks(NamedTuple):
    """Where the hand's marker is in the world, each point (3,) [m].

    Attributes:
        believed: by the joint angles that the agent estimates now.
        seen: as the newest look had it, from the head as the agent believes it to stand; None
            before the first.
        believed_then: at that look.
    """

    believed: Floats
    seen: Floats | None = None
    believed_then: Floats | None = None


class Moment(NamedTuple):
    """What is shown of one moment.

    Attributes:
        time: of the robot [s].
        doing: what the robot does, in a few words.
        tensions: of the wires (m,) [N], true.
        marks: of the hand.
        look_time: when the newest look was [s]; None before the first.
    """

    time: float
    doing: str
    tensions: Floats
    marks: Marks
    observation_time: float | None


class Curves(NamedTuple):
    """Errors of the estimate over time.

    Attributes:
        time: (k,) [s].
        true_deg, true_mm: against the truth (k,): RMS over joints [deg], grip point [mm].
        look_time: (l,) [s].
        seen_deg, seen_mm: against what was seen at each look (l,) [deg, mm].
    """

    time: Floats
    true_deg: Floats
    true_mm: Floats
    observation_time: Floats
    seen_deg: Floats
    seen_mm: Floats


class Story:
    """Notes what happens in a session, step by step."""

    def __init__(self) -> None:
        self._rows: list[tuple[float, float, float]] = []
        self._observations: list[tuple[float, float, float]] = []
        self._seen: object = None
        self._at_look: tuple[Floats, Floats] | None = None

    def note(self, session: Session) -> None:
        """To be called after each step; what is seldom is noted seldom."""
        agent = session.agent
        if agent.seen is not None and agent.seen is not self._seen:
            self._seen = agent.seen
            seen, error = agent.seen.angles, agent.seen.error
            self._observations.append((session.time, *_error(seen + error, seen)))
            self._note_marker(session, seen + error)
        if not self._rows or session.time >= self._rows[-1][0] + NOTE_PERIOD - 1e-9:
            error_now = _error(agent.joint_angles, session.truth["joint_angles"])
            self._rows.append((session.time, *error_now))

    def _note_marker(self, session: Session, estimate: Floats) -> None:
        options, markers = session.agent.options, session.agent.markers
        if options.hand_marker in markers:
            eye = _kinematics().pose(options.camera, estimate)
            seen = eye @ markers[options.hand_marker].pose_marker_in_camera
            believed = _kinematics().pose(options.marker_site, estimate)
            self._at_look = seen[:3, 3], believed[:3, 3]

    def moment(self, session: Session) -> Moment:
        """What is shown now."""
        agent = session.agent
        believed = _kinematics().pose(agent.options.marker_site, agent.joint_angles)[:3, 3]
        learning = "learns" if agent.learning else "is tested: learning is off"
        return Moment(
            session.time,
            session.stage or learning,
            session.world.robot.tensions,
            Marks(believed, *(self._at_look or ())),
            self._observations[-1][0] if self._observations else None,
        )

    def curves(self) -> Curves:
        """The curves so far, thinned to `MOST_POINTS`."""
        rows = np.array(self._rows[:: 1 + len(self._rows) // MOST_POINTS]).reshape(-1, 3)
        return Curves(*rows.T, *np.array(self._observations).reshape(-1, 3).T)


def _error(one: Floats, other: Floats) -> tuple[float, float]:
    """Difference of two postures (n,) [rad]: RMS over joints [deg], distance of the grip [mm]."""
    rmse = float(np.degrees(np.sqrt(np.mean(np.square(one - other)))))
    return rmse, 1e3 * float(np.linalg.norm(grip(one) - grip(other)))


@cache
def _kinematics() -> ArmKinematics:
    return ArmKinematics(asset_path(ARM), JOINTS)


class Scene:
    """A copy of a robot and its world, in which wires have the colours of their tensions.

    Args:
        model: of the robot; it stays as it is.
        muscles: names of the wires, in the order of tensions.
        width, height: of its pictures [pixels].

    Attributes:
        model, data: the copies.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        muscles: tuple[str, ...],
        width: int = WIDTH,
        height: int = HEIGHT,
    ) -> None:
        self.model = model.__copy__()
        self.data = mujoco.MjData(self.model)
        self._muscles = [self.model.tendon(name).id for name in muscles]
        self.model.tendon_width[self._muscles] = MUSCLE_WIDTH
        joints = {self.model.joint(j).name for j in range(self.model.njnt)}
        spooled = [name for name in muscles if spool_joint(name) in joints]
        self._spooled = [self.model.tendon(name).id for name in spooled]
        self._painter = Painter(self.model, width, height)

    def follow(self, data: mujoco.MjData, moment: Moment) -> None:
        """Take over the robot's state, colour the wires, and hide what is wound up of them."""
        mujoco.mj_copyData(self.data, self.model, data)
        points = self.data.wrap_xpos.reshape(-1, 3)
        ends = self.data.ten_wrapadr[self._spooled]
        points[ends] = points[ends + 1]  # from the spool to the guide: no length
        self.model.tendon_rgba[self._muscles] = muscle_colours(moment.tensions)

    def draw(self, marks: Marks) -> Image:
        """The view from outside with the marks, (height, width, 3) uint8, RGB."""
        return self._painter.draw(self.data, OUTSIDE, partial(add_marks, marks=marks))

    def close(self) -> None:
        """Free the GL context, in the thread that drew."""
        self._painter.close()


def place_outside_camera(camera: mujoco.MjvCamera, data: mujoco.MjData) -> None:
    """Put a camera that can be moved where the one is that looks from outside."""
    outside = data.camera(OUTSIDE)
    forward = -outside.xmat.reshape(3, 3)[:, 2]
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.distance = VIEW_DISTANCE
    camera.lookat[:] = outside.xpos + VIEW_DISTANCE * forward
    camera.azimuth = np.degrees(np.arctan2(forward[1], forward[0]))
    camera.elevation = np.degrees(np.arcsin(forward[2]))


def muscle_colours(tensions: Floats) -> Floats:
    """Colours (m, 4) of wires, red, green, blue and opacity in [0, 1], by tension (m,) [N]."""
    colours: Floats = colormaps[MUSCLE_COLOURS](np.clip(tensions / FULL_TENSION, 0.0, 1.0))
    return colours


def add_marks(scene: mujoco.MjvScene, marks: Marks) -> None:
    """Add the hand as believed (a cube), as seen (a ball), and a line to where it was believed."""
    _add(scene, mujoco.mjtGeom.mjGEOM_BOX, marks.believed, BELIEVED)
    if marks.seen is not None and marks.believed_then is not None:
        _add(scene, mujoco.mjtGeom.mjGEOM_SPHERE, marks.seen, SEEN)
        line = _add(scene, mujoco.mjtGeom.mjGEOM_CAPSULE, marks.seen, SEEN)
        if line is not None:
            capsule = int(mujoco.mjtGeom.mjGEOM_CAPSULE)
            mujoco.mjv_connector(line, capsule, 0.003, marks.seen, marks.believed_then)


def _add(
    scene: mujoco.MjvScene, kind: mujoco.mjtGeom, point: Floats, colour: str
) -> mujoco.MjvGeom | None:
    """A new geom of a scene, None where it is full."""
    if scene.ngeom >= scene.maxgeom:
        return None
    geom = scene.geoms[scene.ngeom]
    rgba = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)] + [0.9], np.float32)
    mujoco.mjv_initGeom(
        geom, int(kind), np.full(3, MARK_SIZE), np.asarray(point), np.eye(3).ravel(), rgba
    )
    scene.ngeom += 1
    return geom


class Panel:
    """The picture beside the scene: legend, colours of the wires, curves.

    It makes its axes once and draws them again.
    """

    def __init__(self) -> None:
        figure = Figure(figsize=PANEL_SIZE, dpi=PANEL_DPI)
        self._canvas = FigureCanvasAgg(figure)
        colours = figure.add_axes((0.15, 0.885, 0.8, 0.02))
        joints = figure.add_axes((0.15, 0.45, 0.8, 0.34))
        hand = figure.add_axes((0.15, 0.08, 0.8, 0.33))
        scale = ScalarMappable(Normalize(0.0, FULL_TENSION), MUSCLE_COLOURS)
        figure.colorbar(
            scale, colours, orientation="horizontal", extend="max", label="tension of a wire [N]"
        )
        self._axes = joints, hand
        self._lines = [
            _empty(joints, "joint angles: RMSE [deg]"),
            _empty(hand, "grip point: distance [mm]"),
        ]
        hand.set_xlabel("time of the robot [s]")
        believed = Line2D([], [], ls="", marker="s", ms=9, color=BELIEVED, label="hand as believed")
        seen = Line2D([], [], marker="o", ms=9, color=SEEN, label="hand as last seen")
        marks = [believed, seen, *self._lines[0]]
        figure.legend(handles=marks, loc="upper center", ncols=2, frameon=False)

    def draw(self, curves: Curves) -> Image:
        """The picture (600, 460, 3) uint8, RGB."""
        errors = (curves.true_deg, curves.seen_deg), (curves.true_mm, curves.seen_mm)
        for axes, (line, dots), (true, seen) in zip(self._axes, self._lines, errors, strict=True):
            line.set_data(curves.time, true)
            dots.set_data(curves.observation_time, seen)
            axes.set_ylim(0.0, 1.15 * max([1e-3, *true, *seen]))
            axes.set_xlim(0.0, 1.03 * max([1.0, *curves.time]))
        self._canvas.draw()
        return np.ascontiguousarray(np.asarray(self._canvas.buffer_rgba())[:, :, :3])


def _empty(axes: Axes, label: str) -> tuple[Line2D, Line2D]:
    """An empty curve over time and empty dots at the looks."""
    (line,) = axes.plot([], [], color="#444444", lw=1.5, label="estimate - true")
    (dots,) = axes.plot([], [], "o", color=SEEN, ms=4, label="estimate - seen, at a look")
    axes.set_ylabel(label)
    axes.grid(alpha=0.3)
    return line, dots
