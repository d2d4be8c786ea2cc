"""Small valid files of each kind, which the fuzzer changes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet

MODEL = """<mujoco model="lever">
  <compiler meshdir="forms"/>
  <option timestep="0.002"/>
  <default><geom rgba=".5 .5 .5 1"/><default class="thick"><geom size="0.03"/></default></default>
  <asset>
    <mesh name="bone" file="bone.obj"/>
    <texture name="flat" type="2d" builtin="checker" width="8" height="8"/>
    <material name="flat" texture="flat"/>
    <hfield name="ground" nrow="2" ncol="2" size="1 1 .1 .1"/>
    <model name="part" file="part.xml"/>
  </asset>
  <worldbody>
    <site name="flexor_0" pos="0.05 0 0.1"/>
    <geom type="hfield" hfield="ground" pos="0 0 -2" contype="0" conaffinity="0"/>
    <replicate count="2" offset="1 0 0"><geom type="sphere" size=".1" contype="0"/></replicate>
    <body name="lever">
      <joint name="elbow" axis="0 -1 0" range="-60 60" damping="1"/>
      <geom class="thick" type="capsule" fromto="0 0 0 0 0 -0.3" mass="1"/>
      <geom type="mesh" mesh="bone" material="flat" mass="0.01" contype="0"/>
      <site name="flexor_1" pos="0.03 0 -0.1"/>
    </body>
    <attach model="part" body="knob" prefix="a_"/>
    <include file="more.xml"/>
  </worldbody>
  <tendon>
    <spatial name="flexor"><site site="flexor_0"/><site site="flexor_1"/></spatial>
  </tendon>
  <actuator>
    <general name="flexor" tendon="flexor" gainprm="500" biastype="affine"
             biasprm="-10 -500 0" forcelimited="true" forcerange="-400 -10"/>
  </actuator>
  <sensor>
    <tendonpos name="length" tendon="flexor"/>
    <jointpos name="angle" joint="elbow"/>
  </sensor>
  <keyframe><key name="bent" qpos="0.5"/></keyframe>
</mujoco>
"""
PART = """<mujoco>
  <worldbody><body name="knob"><geom type="sphere" size="0.1" contype="0"/></body></worldbody>
</mujoco>
"""
MORE = """<mujoco><geom type="box" size=".1 .1 .1" pos="3 0 0" contype="0"/></mujoco>
"""
BONE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
STUDY = """name: a lever
model: model.xml
episodes:
  - commands: log{suffix}
    joints: {{elbow: 0.1}}
time: {{column: time, unit: s}}
actuators:
  flexor: {{column: target_flexor, unit: m}}
sensors:
  length: {{column: length_flexor, unit: mm, scale: 1000, offset: 0.0, noise: 0.1}}
  angle: {{columns: [angle_elbow], unit: rad}}
initial: {{joints: first_reading, settle: 0.5}}
"""


def study(folder: Path, suffix: str) -> None:
    """Write a study of one episode.

    Args:
        folder: empty folder.
        suffix: of the log, ".csv" or ".parquet".
    """
    (folder / "forms").mkdir()
    texts = {
        "model.xml": MODEL,
        "part.xml": PART,
        "more.xml": MORE,
        "forms/bone.obj": BONE,
        "STUDY.yaml": STUDY.format(suffix=suffix),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    log = _log()
    if suffix == ".parquet":
        pyarrow.parquet.write_table(pa.table(log), folder / "log.parquet")
    else:
        rows = np.column_stack(list(log.values()))
        lines = [",".join(log), *(",".join(f"{cell:.6g}" for cell in row) for row in rows)]
        (folder / "log.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _log() -> dict[str, np.ndarray]:
    time = 0.02 * np.arange(40)
    angle = 0.3 * np.sin(3.0 * time)
    return {
        "time": time,
        "target_flexor": 0.2 - 0.03 * angle,
        "length_flexor": 0.21 - 0.03 * angle,
        "angle_elbow": angle,
    }


def checkpoints(folder: Path) -> None:
    """Write a map, a checkpoint of an experiment, and one of a diagnosis."""
    from jmm_agent.mapping.group_map import GroupMap
    from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
    from mjcf_sandbox.files import write_json
    from reality_gap.inference.checkpoint import Checkpoint
    from tools.fuzz.targets import KEY, RESULT

    random = np.random.default_rng(0)
    group = GroupMap(
        "all",
        np.array([0, 1]),
        np.array([0, 1, 2]),
        np.zeros(2),
        np.ones(2),
        random.normal(size=(4, 2)),
        random.normal(size=4),
        random.normal(size=(3, 4)),
        random.normal(size=3),
    )
    JointMuscleMap(("elbow", "wrist"), ("a", "b", "c"), (group,)).save(folder / "map.npz")
    write_json(folder / "task.json", {"key": KEY, "seconds": 1.0, "result": RESULT})
    Checkpoint(folder / "checkpoint", KEY).get(0, lambda: [np.arange(3, dtype=np.float32)])


def bags(folder: Path) -> None:
    """Write the same two topics to a ROS 1 bag, and to ROS 2 bags in SQLite and MCAP."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores

    with Writer1(folder / "one.bag") as writer:
        _write_messages(writer, Stores.ROS1_NOETIC)
    for name, plugin in (("sqlite", StoragePlugin.SQLITE3), ("mcap", StoragePlugin.MCAP)):
        with Writer2(folder / name, version=9, storage_plugin=plugin) as writer2:
            _write_messages(writer2, Stores.ROS2_HUMBLE)
    (recorded,) = (folder / "mcap").glob("*.mcap")
    recorded.rename(folder / "mcap" / "mcap.mcap")
    (stored,) = (folder / "sqlite").glob("*.db3")
    stored.rename(folder / "sqlite" / "sqlite.db3")


def _write_messages(writer: object, version: object) -> None:
    """Write five messages to each topic."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(version)  # type: ignore[arg-type]
    first = version is Stores.ROS1_NOETIC
    kinds = store.types
    connections = {
        topic: writer.add_connection(topic, kind, typestore=store)  # type: ignore[attr-defined]
        for topic, kind in (
            ("/joints", "sensor_msgs/msg/JointState"),
            ("/target", "std_msgs/msg/Float64"),
        )
    }
    for i in range(5):
        stamp = kinds["builtin_interfaces/msg/Time"](sec=1_700_000_000 + i, nanosec=0)
        number = {"seq": i} if first else {}
        header = kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="base", **number)
        state = kinds["sensor_msgs/msg/JointState"](
            header=header,
            name=["elbow", "wrist"],
            position=np.array([0.1 * i, 0.2]),
            velocity=np.zeros(0),
            effort=np.zeros(0),
        )
        value = kinds["std_msgs/msg/Float64"](data=float(i))
        serialize = store.serialize_ros1 if first else store.serialize_cdr
        for topic, message in (("/joints", state), ("/target", value)):
            timestamp = 1_700_000_000_000_000_000 + i * 10**9
            raw = serialize(message, message.__msgtype__)
            writer.write(connections[topic], timestamp, raw)  # type: ignore[attr-defined]


MAKERS: dict[str, Callable[[Path], None]] = {
    "mjcf": lambda folder: study(folder, ".csv"),
    "yaml": lambda folder: study(folder, ".csv"),
    "csv": lambda folder: study(folder, ".csv"),
    "parquet": lambda folder: study(folder, ".parquet"),
    "checkpoint": checkpoints,
    "bag": bags,
}
"""By kind: writes the valid files to an empty folder."""

CHANGED: dict[str, tuple[str, ...]] = {
    "mjcf": ("model.xml", "model.xml", "model.xml", "part.xml", "more.xml", "forms/bone.obj"),
    "yaml": ("STUDY.yaml",),
    "csv": ("log.csv",),
    "parquet": ("log.parquet",),
    "checkpoint": ("map.npz", "map.npz", "task.json", "checkpoint/00000.npz"),
    "bag": ("one.bag", "sqlite/metadata.yaml", "sqlite/sqlite.db3", "mcap/mcap.mcap"),
}
"""By kind: files that are changed, one in each case; repeated entries are chosen more often."""
