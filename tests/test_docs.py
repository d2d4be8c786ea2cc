"""What the documentation says is so: its Python runs, and its tables are those of the results."""

from __future__ import annotations

import ast
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.__main__ import RUNNERS
from kengoro.trained_maps import trained_map
from reality_gap.causes import CATALOGUE, joint_stiffness
from reality_gap.causes.support import elements
from tests.snippets import blocks

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
SLOW = ("own_robot.md",)
"""Pages whose code takes longer than 20 s."""

TABLE = re.compile(r"<!-- (results/\S+\.json): (.+) -->\n((?:\|.*\n)+)")
"""A table of a result: file, title, rows."""


def small_study() -> dict[str, Any]:
    """A study in this folder, and the parts of a cause."""
    Path("rod.xml").write_text(
        """<mujoco><option integrator="implicitfast"/><worldbody><body>
        <joint name="hinge" axis="0 1 0" damping="0.05"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02" mass="1"/></body></worldbody>
        <actuator><position name="motor" joint="hinge" kp="10" kv="1"/></actuator>
        <sensor><jointpos name="angle" joint="hinge"/></sensor></mujoco>""",
        encoding="utf-8",
    )
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 2.0, 0.02)
    rows = np.column_stack([time, 0.0 * time, 1e-3 * rng.standard_normal(len(time))])
    np.savetxt("log.csv", rows, delimiter=",", header="t,target,angle", comments="")
    Path("STUDY.yaml").write_text(
        """{name: rod, model: rod.xml, episodes: [{commands: log.csv}], time: {column: t, unit: s},
        actuators: {motor: {column: target, unit: rad}},
        sensors: {angle: {column: angle, unit: rad, noise: 1.0e-3}}}""",
        encoding="utf-8",
    )
    spring = joint_stiffness.CAUSE
    return {"locations": elements.each_joint, "parameters": spring.parameters, "edit": spring.edit}


def small_robot() -> dict[str, Any]:
    """The drawing that the page shows, and a marker for it."""
    [drawing] = re.findall(r"```xml\n(.*?)```", (ROOT / "docs/own_robot.md").read_text(), re.S)
    Path("arm3.xml").write_text(drawing, encoding="utf-8")
    shutil.copy(ROOT / "assets/mjcf/kengoro_arm/textures/marker_hand.png", "marker.png")
    return {}


def calibrated_camera() -> dict[str, Any]:
    """A ROS calibration file in the current folder, and a CameraInfo message as a dictionary."""
    Path("head_camera.yaml").write_text(CAMERA_FILE, encoding="utf-8")
    distortion = [-0.3, 0.08, 0.001, -0.002, 0.0]
    matrix = [580.0, 0.0, 344.5, 0.0, 560.0, 222.5, 0.0, 0.0, 1.0]
    size = {"width": 640, "height": 480, "distortion_model": "plumb_bob"}
    return {"message": size | {"k": matrix, "d": distortion}}


CAMERA_FILE = """\
image_width: 640
image_height: 480
camera_name: head
camera_matrix: {rows: 3, cols: 3, data: [580.0, 0.0, 344.5, 0.0, 560.0, 222.5, 0.0, 0.0, 1.0]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.3, 0.08, 0.001, -0.002, 0.0]}
"""
"""As the camera_calibration package of ROS writes it."""

GIVEN: dict[str, Callable[[], dict[str, Any]]] = {
    "docs/camera.md": calibrated_camera,
    "docs/reality_gap.md": small_study,
    "docs/own_robot.md": small_robot,
    "docs/observe.md": small_robot,
}
"""What the blocks of a page find beside themselves, where it is the user's own."""


def learned_and_named(namespace: dict[str, Any], output: str) -> None:
    """It missed before it learned and not after, and the cause was named."""
    lines = [line.split() for line in output.splitlines()]
    before, learned = (
        [float(line[1]) for line in lines if line[0] == learning] for learning in ("False", "True")
    )
    assert (len(before), len(learned)) == (5, 4)
    assert max(learned) < 0.25 < 0.5 < max(before)
    assert "Displaced attachment at lift_1" in output
    code = [line for _, block in blocks(ROOT / "docs/own_robot.md") for line in block.splitlines()]
    assert sum(bool(line.strip()) for line in code) < 60  # as promised


def learned_from_a_tracker(namespace: dict[str, Any], output: str) -> None:
    """It missed before it learned and not after, and no encoder contradicts."""
    errors = dict(re.findall(r"^(before|learned) \[(.*?)\]", output, re.MULTILINE))
    before, after = (np.array(errors[key].split(", "), float) for key in ("before", "learned"))
    assert after.mean() < before.mean() / 3
    assert "contradicted: {}" in output


EXPECTED: dict[str, Callable[[dict[str, Any], str], None]] = {
    "docs/own_robot.md": learned_and_named,
    "docs/observe.md": learned_from_a_tracker,
}
"""What the blocks of a page must have done."""


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(
            page,
            id=page.relative_to(ROOT).as_posix(),
            marks=pytest.mark.slow if page.name in SLOW else (),
        )
        for page in PAGES
        if any(blocks(page))
    ],
)
def test_python_in_the_documentation_runs(
    page: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    request: pytest.FixtureRequest,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    name = page.relative_to(ROOT).as_posix()
    code = list(blocks(page))
    if any("make_agent" in block for _, block in code):  # trained once for all tests
        maps = request.config.cache.mkdir("maps")
        trained_map(maps)
        monkeypatch.setattr("kengoro.trained_maps.default_cache", lambda: maps)
    namespace: dict[str, Any] = {"__name__": "__main__"}
    if name in GIVEN:
        namespace |= GIVEN[name]()
    catalogue = dict(CATALOGUE)
    try:
        for line, block in code:
            exec(compile("\n" * line + block, str(page), "exec"), namespace)
        if name in EXPECTED:
            EXPECTED[name](namespace, capsys.readouterr().out)
    finally:
        CATALOGUE.clear()
        CATALOGUE.update(catalogue)


@pytest.mark.slow
@pytest.mark.torch
@pytest.mark.parametrize("algorithm", ["PPO", "SAC"])
def test_the_learning_example_learns(
    algorithm: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = (ROOT / "docs" / "rl.md").read_text(encoding="utf-8")
    [code] = re.findall(r"```python\n([^`]*import PPO as Algorithm[^`]*)```", page)
    assert sum(bool(line.strip()) for line in code.splitlines()) <= 20  # as promised
    monkeypatch.chdir(tmp_path)
    few = code.replace("import PPO", f"import {algorithm}").replace("60_000", "128")
    if algorithm == "PPO":
        few = few.replace("settings = {", 'settings = {"n_steps": 64, ')  # 2048, and 5 steps each
    namespace: dict[str, Any] = {"__name__": "__main__"}
    exec(compile(few, "docs/rl.md", "exec"), namespace)
    assert namespace["model"].num_timesteps >= 128
    assert namespace["model"]._n_updates > 0
    assert (tmp_path / "posture.zip").stat().st_size > 1000


def test_tables_of_results_are_those_of_the_files() -> None:
    found = 0
    for page in PAGES:
        for file, title, shown in TABLE.findall(page.read_text(encoding="utf-8")):
            summary = json.loads((ROOT / "docs" / file).read_text(encoding="utf-8"))
            tables = [*summary.get("tables", []), *filter(None, [summary.get("table")])]
            (table,) = (table for table in tables if table["title"] == title)
            rows = [table["head"], ["---"] * len(table["head"]), *table["rows"]]
            output = [line.strip("|").split("|") for line in shown.splitlines()]
            assert [[cell.strip() for cell in row] for row in output] == rows, f"{page}: {title}"
            found += 1
    assert found


def test_every_experiment_is_documented() -> None:
    page = (ROOT / "docs" / "experiments.md").read_text(encoding="utf-8")
    assert [
        name for name in RUNNERS if not re.search(rf"`{name}`|^## .*\b{name}\b", page, re.M)
    ] == []


@pytest.mark.parametrize(("page", "most"), [("README.md", 3), ("docs/own_robot.md", 8)])
def test_few_imports_suffice(page: str, most: int) -> None:
    code = "\n".join(block for _, block in blocks(ROOT / page))
    nodes = ast.walk(ast.parse(code))
    assert sum(isinstance(node, ast.Import | ast.ImportFrom) for node in nodes) <= most
