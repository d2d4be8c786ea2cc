"""Loaders of public logs: units, signs and couplings of files as their authors write them."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from experiments.harness.errors import ExperimentError
from experiments.real_machines import aero_hand, psm, so101, tiago, two_link, tx40
from experiments.real_machines.baselines import fit, fit_by_mujoco
from experiments.real_machines.machines import MACHINES
from experiments.real_machines.models import read_model, write_model
from experiments.real_machines.parameters import expand, predict
from jmm_agent.types import Floats
from reality_gap.simulation.inverse_dynamics import ensure_prepared
from reality_gap.study.data import Study
from reality_gap.study.measurements import measured


def urdf(joints: tuple[str, ...]) -> str:
    """A chain of links with meshes that do not exist, as in the repositories."""
    links = ['<link name="base"/>']
    for k, joint in enumerate(joints):
        parent = "base" if k == 0 else joints[k - 1] + "_link"
        links.append(
            f'<link name="{joint}_link"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>'
            '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>'
            '<visual><geometry><mesh filename="package://robot/none.stl"/></geometry></visual>'
            f'</link><joint name="{joint}" type="revolute"><parent link="{parent}"/>'
            f'<child link="{joint}_link"/><origin xyz="0.2 0 0"/><axis xyz="0 1 0"/>'
            '<limit lower="-3" upper="3" effort="9" velocity="3"/></joint>'
        )
    return f'<robot name="arm">{"".join(links)}</robot>'


def save(path: Path, table: Floats, head: str = "") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(path, table, delimiter=",", header=head, comments="")
    return path


def motion(time: Floats, count: int) -> Floats:
    """Motion of some joints, shape (n, count)."""
    return np.column_stack([0.4 * np.sin((1.0 + 0.3 * k) * time + k) for k in range(count)])


def values(study: Study, channel: str) -> Floats:
    """Readings of a channel of the first episode."""
    names = [one.name for one in study.channels]
    return study.episodes[0].readings[names.index(channel)].value


def test_currents_of_tiago_become_torques(tmp_path: Path) -> None:
    time = np.arange(0.0, 32.0, 0.01)
    angles = motion(time, 8)
    folder = tmp_path / tiago.LOG
    save(folder / "tiago_position.csv", np.column_stack([time, angles]), "t,q")
    save(folder / "tiago_effort.csv", np.column_stack([time, np.full((len(time), 8), 0.5)]), "t,i")
    model = tmp_path / tiago.MODEL
    model.parent.mkdir(parents=True)
    model.write_text(urdf((*tiago.JOINTS, "gripper_joint")))
    study = MACHINES["tiago"].study(tmp_path, tmp_path / "out", 10.0)
    assert study.duration == pytest.approx(10.0, abs=0.02)
    # 0.5 A; ratio 100, and 0.136 and -0.087 N m/A.
    assert values(study, "arm_1_joint effort") == pytest.approx(6.8)
    assert values(study, "arm_3_joint effort") == pytest.approx(-4.35)
    assert values(study, "arm_6_joint position")[0] == pytest.approx(angles[2000, 6])
    assert {joint.name for joint in study.spec().joints} == set(tiago.JOINTS)


def test_the_coupled_wrist_of_the_tx40_is_resolved(tmp_path: Path) -> None:
    time = np.arange(0.0, 4.0, tx40.STEP)
    angles = motion(time, 6)
    motors = angles - np.array([0.0, -np.pi / 2, np.pi / 2, 0.0, 0.0, 0.0])
    motors[:, 5] += motors[:, 4]
    motors *= np.array([32.0, 32.0, 45.0, -48.0, 45.0, 32.0])
    save(tmp_path / tx40.POSITION, motors, "q")
    save(tmp_path / tx40.TORQUE, np.full_like(motors, 0.25), "t")
    model = tmp_path / tx40.MODEL
    model.parent.mkdir(parents=True)
    model.write_text(urdf(tx40.JOINTS))
    study = tx40.make_study(tmp_path, tmp_path / "out", 3.0)
    assert study.duration == pytest.approx(3.0, abs=0.01)
    for k in range(6):
        found = values(study, f"joint_{k + 1} position")
        assert found[:2000] == pytest.approx(angles[2:10002:5, k], abs=1e-4)
    assert values(study, "joint_4 effort") == pytest.approx(-48.0 * 0.25)
    published = MACHINES["tx40"].published
    assert published is not None
    assert published["friction joint_2"] == 8.26


def test_efforts_of_the_psm_follow_its_speeds(tmp_path: Path) -> None:
    time = np.arange(0.0, 16.0, 1.0 / psm.RATE)
    table = np.column_stack([motion(time, 7), np.zeros((len(time), 7)), motion(time, 14)[:, 7:]])
    save(tmp_path / psm.LOG, table)
    study = psm.make_study(tmp_path, tmp_path / "out", 10.0)
    assert study.duration == pytest.approx(10.0, abs=0.01)
    assert values(study, "insertion position")[0] == pytest.approx(table[1000, 2])
    assert values(study, "insertion effort")[0] == pytest.approx(table[1000, 16])
    assert [channel.unit for channel in study.channels[3:]] == ["N m", "N m", "N"]


def two_link_log(path: Path, tip: float, friction: float) -> Path:
    """Log of the two-link arm with a mass at its tip [kg] and friction in its elbow [N m]."""
    time = np.arange(0.0, 14.0, 0.01)
    q = motion(time, 2)
    v, a = (np.gradient(q, 0.01, axis=0), np.gradient(np.gradient(q, 0.01, axis=0), 0.01, axis=0))
    spec = mujoco.MjSpec.from_string(two_link.MODEL)
    spec.body("lower").add_geom(size=[1e-3, 0, 0], pos=[0.2, 0, 0], mass=tip)
    model = spec.compile()
    data = mujoco.MjData(model)
    rows = []
    for k, now in enumerate(time):
        data.qpos, data.qvel, data.qacc = q[k], v[k], a[k]
        mujoco.mj_inverse(model, data)
        effort = data.qfrc_inverse + np.array([0.0, friction * np.sign(v[k, 1])])
        angles = (q[k, 0], v[k, 0], q[k].sum(), v[k].sum())
        rows.append([now, *angles, *(two_link.UNITS_PER_TORQUE * effort)])
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(path, rows)
    return path


def test_parameters_are_fitted_joint_by_joint(tmp_path: Path) -> None:
    two_link_log(tmp_path / two_link.LOG, 0.0, 0.05)
    raw = two_link.make_study(tmp_path, tmp_path / "out", 8.0)
    # With this noise of efforts, that of positions does not matter, and nothing is weighted.
    channels = tuple(replace(c, noise=0.1) if c.kind == "effort" else c for c in raw.channels)
    study = ensure_prepared(replace(raw, channels=channels))
    readings = measured(study)
    nominal = predict(study, readings, {}) - readings.value
    assert np.sqrt(np.mean(nominal[readings.channel == 0] ** 2)) < 2e-3
    assert [one.key for one in expand(study, ("mass", "delay"))] == [
        "mass upper",
        "mass lower",
        "delay",
    ]
    [one] = expand(study, ("friction",), shared=True)
    assert (one.key, one.low) == ("friction", 0.0)
    for found in (fit(study, ("friction", "mass")), fit_by_mujoco(study, ("friction", "mass"))):
        assert found.values["friction elbow"] == pytest.approx(0.05, abs=2e-3)
        assert found.values["friction shoulder"] == pytest.approx(0.0, abs=2e-3)
        assert found.values["mass lower"] == pytest.approx(0.0, abs=0.02)
    model, shifted, late = (
        predict(study, readings, one) for one in ({}, {"offset elbow": 0.1}, {"delay": 0.05})
    )
    elbow = readings.channel == 1
    assert shifted - model == pytest.approx(np.where(elbow, 0.1, 0.0), abs=1e-6)
    time = readings.time[elbow]
    before = np.interp(time - 0.05, time, model[elbow])
    assert late[elbow][10:] == pytest.approx(before[10:], abs=0.02 * np.ptp(before))
    both = predict(study, readings, {"friction elbow": 0.02, "friction": 0.03})
    assert both[readings.channel == 1] == pytest.approx(
        predict(study, readings, {"friction elbow": 0.05})[readings.channel == 1], abs=1e-9
    )


def arm() -> str:
    """MJCF of an arm with the joints of the SO-101, and a gripper with a mesh."""
    bodies, end = "", ""
    for k, joint in enumerate((*so101.JOINTS, "gripper")):
        bodies += (
            f'<body pos="0.1 0 0"><joint name="{joint}" axis="0 {k % 2} {1 - k % 2}" '
            'damping="0.6" armature="0.028"/><inertial pos="0.05 0 0" mass="0.1" '
            'diaginertia="1e-4 1e-4 1e-4"/><geom type="mesh" mesh="part"/>'
        )
        end += "</body>"
    motors = "".join(
        f'<position name="{joint}" joint="{joint}" kp="998.22" kv="2.731"/>'
        for joint in (*so101.JOINTS, "gripper")
    )
    return (
        '<mujoco><asset><mesh name="part" file="none.stl"/></asset>'
        f"<worldbody>{bodies}{end}</worldbody><actuator>{motors}</actuator></mujoco>"
    )


def write_motion(folder: Path, steps: int) -> None:
    """Write a motion in the format of the SO-101 logs."""
    folder.mkdir(parents=True)
    for name, kind in (("control.csv", "CONTROL"), ("state_motor.csv", "STATE_MOTOR")):
        with (folder / name).open("w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(["type", "timestamp", "positions"])
            for k in range(steps):
                angles = [0.1 * np.sin(0.05 * k + joint) for joint in range(6)]
                rows.writerow([kind, 7.1 + 20_000.0 * k, json.dumps(angles)])


def test_motions_of_the_so101_become_episodes(tmp_path: Path) -> None:
    folder = tmp_path / so101.FOLDER
    for name in so101.MOTIONS:
        write_motion(folder / name, 200)
    (tmp_path / so101.MODEL).write_text(arm())
    study = so101.make_study(tmp_path, tmp_path / "out", 4.0)
    assert [episode.duration for episode in study.episodes] == pytest.approx([2.0, 2.0])
    model = study.spec().compile()
    assert model.nu == model.nv == 5
    assert study.episodes[0].command[1] == pytest.approx(
        [0.1 * np.sin(0.05 + joint) for joint in range(5)]
    )
    study = ensure_prepared(study)
    gain = [one for one in expand(study, ("gain", "servo_damping")) if "elbow" in one.key]
    assert [one.key for one in gain] == ["gain elbow_flex", "servo_damping elbow_flex"]
    softer = predict(study, measured(study), dict(so101.PUBLISHED))
    assert np.all(np.isfinite(softer))
    # BAM: duty cycle of 0.166 per unit of the gain of 16, 7.4 V, 1.212 N m/A, 2.676 Ohm.
    assert (1.0 + so101.PUBLISHED["gain"]) * 998.22 == pytest.approx(8.90, abs=0.01)


def test_a_servo_of_the_hand_winds_its_tendon(tmp_path: Path) -> None:
    fingers, tendons, motors, sensors = "", "", "", ""
    for finger in aero_hand.FINGERS:
        parts = ("mcp_flex", "pip", "dip")
        bodies = "".join(
            f'<body pos="0 0 0.03"><joint name="right_{finger}_{part}" axis="0 1 0"/>'
            '<geom size="0.005" mass="0.01"/>'
            for part in parts
        )
        fingers += (
            f'<site name="{finger}_a"/>{bodies}<site name="{finger}_b" pos="0.01 0 0.02"/>'
            f"{'</body>' * len(parts)}"
        )
        tendon = f"{finger[0]}f_tendon0"
        tendons += f'<spatial name="{tendon}"><site site="{finger}_a"/><site site="{finger}_b"/>'
        tendons += "</spatial>"
        motors += f'<position name="right_{finger}_A_pip" tendon="{tendon}" ctrlrange="0.07 0.11"/>'
        sensors += f'<tendonpos name="len_{finger[0]}f" tendon="{tendon}"/>'
    folder = tmp_path / aero_hand.FOLDER
    folder.mkdir()
    (tmp_path / aero_hand.MODEL).write_text(
        f"<mujoco><worldbody>{fingers}</worldbody><tendon>{tendons}</tendon>"
        f"<actuator>{motors}</actuator><sensor>{sensors}</sensor></mujoco>"
    )
    for number in aero_hand.FINGERS.values():
        rows = [[100.0 + 0.25 * k, 39321 * (k % 4 > 1), 20 * k] for k in range(40)]
        head = f"timestamp,servo_{number}_sent,servo_{number}_read"
        save(folder / f"motor_data_{number}.csv", np.array(rows), head)
    study = aero_hand.make_study(tmp_path, tmp_path / "out", 8.0)
    assert [episode.name for episode in study.episodes] == list(aero_hand.FINGERS)
    command = study.episodes[0].command
    # 39321 counts of 65535 wind 0.6 of 0.04445 m, from the largest length of 0.11 m.
    assert command[2] == pytest.approx([0.11 - 0.02667, 0.11], abs=1e-6)
    assert values(study, "index tendon")[1] == pytest.approx(0.11 - 20 * 0.04445 / 65535)
    assert len(study.episodes[1].readings[0].time) == 0


def test_models_without_meshes_or_with_impossible_inertia_compile(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(urdf(("a", "b")).replace('ixx="0.01"', 'ixx="-0.01"', 1))
    model = write_model(read_model(path, ("b",)), tmp_path / "out" / "model.xml")
    compiled = mujoco.MjModel.from_xml_path(str(model))
    assert compiled.njnt == 1
    with pytest.raises(ExperimentError, match="no joint 'c'"):
        read_model(path, ("b", "c"))
    with pytest.raises(ExperimentError, match="cannot be read as a model"):
        read_model(tmp_path / "none.xml", ("b",))


def test_broken_tables_get_one_sentence(tmp_path: Path) -> None:
    save(tmp_path / tx40.POSITION, np.zeros((10, 4)), "q")
    with pytest.raises(ExperimentError, match=r"pos_read_data\.csv has 4 columns; 6 columns"):
        tx40.make_study(tmp_path, tmp_path / "out", 3.0)
    (tmp_path / tx40.POSITION).write_text("q\n1,2\n3,x\n")
    with pytest.raises(ExperimentError, match="cannot be read as a table"):
        tx40.make_study(tmp_path, tmp_path / "out", 3.0)
    folder = tmp_path / aero_hand.FOLDER
    folder.mkdir()
    save(folder / "log.csv", np.zeros((3, 2)), "timestamp,other")
    with pytest.raises(ExperimentError, match="servo_5_sent"):
        aero_hand.read_log(folder / "log.csv", 5)
    with pytest.raises(ExperimentError, match="cannot be read as a log of the SO-101"):
        so101.read_positions(folder / "log.csv")
