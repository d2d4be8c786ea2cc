"""Images are rendered without a display and without MUJOCO_GL; else an error gives the reason."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from kengoro_env.assets import asset_path
from kengoro_env.departures import TendonStretch
from kengoro_env.errors import RenderingError
from kengoro_env.postures import posture_set
from kengoro_env.robot.robot import Robot
from kengoro_env.vision import gl_backend, rendering
from kengoro_env.vision.rendering import Painter
from tests.kengoro_env.vision.frames import painted

ROOT = Path(__file__).resolve().parents[3]
SCENE = asset_path("mjcf/kengoro_arm/posture.xml")

DRAW = """
import gymnasium, kengoro_env
env = gymnasium.make("Kengoro/Elbow-v0", render_mode="rgb_array")
env.reset(seed=0)
print(env.render().std() > 5.0)
env.close()
"""


def python(program: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run a program in a fresh interpreter, headless, with no GL variable but those given."""
    environment = {
        name: value
        for name, value in os.environ.items()
        if name not in ("DISPLAY", "MUJOCO_GL", "PYOPENGL_PLATFORM")
    }
    return subprocess.run(
        [sys.executable, "-c", program],
        cwd=ROOT,
        env={**environment, **variables},
        capture_output=True,
        text=True,
        timeout=120.0,
    )


@pytest.mark.parametrize("before", ["", "import mujoco\n"], ids=["first", "after mujoco"])
def test_draws_headless_without_any_variable(before: str) -> None:
    done = python(before + DRAW)
    assert done.stdout.strip() == "True", done.stderr
    assert done.stderr == ""


@pytest.mark.skipif(not gl_backend.is_installed("egl"), reason="there is no EGL here")
@pytest.mark.parametrize(
    ("before", "display"), [("", ":99"), ("import mujoco\n", "localhost:10.0")]
)
def test_egl_draws_where_the_display_is_gone(before: str, display: str) -> None:
    """As after ``ssh -X`` whose connection was closed."""
    done = python(before + DRAW, DISPLAY=display)
    assert done.stdout.strip() == "True", done.stderr


@pytest.mark.parametrize("module", ["kengoro demo", "experiments emps", "reality_gap causes", ""])
def test_a_backend_that_does_not_exist_is_a_sentence(module: str) -> None:
    program = "import kengoro_env"
    if module:
        name, command = module.split()
        program = f"import sys; from {name}.__main__ import main; sys.exit(main(['{command}']))"
    done = python(program, MUJOCO_GL="foo")
    assert done.returncode != 0
    lines = done.stderr.strip().splitlines()
    if module:
        assert len(lines) == 1
    assert "MUJOCO_GL" in lines[-1]
    assert "foo" in lines[-1]
    assert "unset it, or set it to" in lines[-1]
    assert "egl, osmesa, glfw" in lines[-1]


@pytest.mark.parametrize("chosen", ["osmesa", "glfw", "disable"])
def test_a_backend_that_does_not_work_here_is_a_sentence(chosen: str) -> None:
    if chosen == "osmesa" and gl_backend.is_installed("osmesa"):
        pytest.skip("OSMesa works here")
    program = "try:\n  " + DRAW.replace("\n", "\n  ") + "\nexcept Exception as e: print(e)"
    done = python(program, MUJOCO_GL=chosen)
    assert done.returncode == 0, done.stderr
    assert f"MUJOCO_GL={chosen}" in done.stdout
    assert "unset it, or install the libraries of that backend" in done.stdout
    assert done.stdout.count("\n") == 1


def test_the_error_without_a_library_names_the_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl_backend, "candidates", lambda: ())
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    with pytest.raises(RenderingError, match=r"no GL library found.*apt-get install libegl1"):
        rendering.open_renderer(model)


@pytest.mark.parametrize(
    ("variables", "libraries", "expected"),
    [
        ({}, {"egl", "osmesa"}, ("egl", "osmesa")),
        ({}, {"osmesa"}, ("osmesa",)),
        ({}, set(), ()),
        ({"DISPLAY": ":0"}, {"egl"}, ("glfw", "egl")),
        ({"DISPLAY": ":99"}, {"egl"}, ("egl",)),
        ({"MUJOCO_GL": "EGL"}, {"osmesa"}, ("egl",)),
    ],
)
def test_order_of_backends(
    variables: dict[str, str],
    libraries: set[str],
    expected: tuple[str, ...],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(gl_backend, "is_installed", lambda backend: backend in libraries)
    monkeypatch.setattr(gl_backend, "_opens", lambda name: name == ":0")
    for name in ("DISPLAY", "MUJOCO_GL"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert gl_backend.candidates() == expected


def test_what_a_user_chose_stays() -> None:
    program = "import os, kengoro_env; print(os.environ.get('MUJOCO_GL'))"
    assert python(program, MUJOCO_GL="glfw").stdout.strip() == "glfw"
    assert python(program, MUJOCO_GL="off").stdout.strip() == "off"


def test_the_part_of_a_tendon_on_its_spool_is_not_rendered() -> None:
    pictures = []
    for departures in ((), (TendonStretch(1e-5),)):
        robot = Robot(SCENE, departures)
        robot.reset(posture_set()[0], np.random.default_rng(0))
        painter = Painter(robot.model)
        pictures.append(painter.draw(robot.data, "outside").astype(int))
        painter.close()
    differ = np.abs(pictures[0] - pictures[1]).max(axis=2) > 40
    assert differ.mean() < 2e-4  # with the parts on the spools rendered, 1.4 % differ


def test_shadows_are_left_out() -> None:
    spec = mujoco.MjSpec.from_file(str(SCENE))
    spec.worldbody.add_light(pos=[1, 1, 3], dir=[-1, -1, -3], castshadow=True)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    painter = Painter(model)
    painter.draw(data, "outside")
    assert painter._renderer is not None
    flags = painter._renderer.scene.flags
    assert not flags[mujoco.mjtRndFlag.mjRND_SHADOW]
    assert not flags[mujoco.mjtRndFlag.mjRND_REFLECTION]
    painter.close()


def rendered_in_full(robot: Robot, camera: str, tendons: bool = True) -> np.ndarray:
    """MuJoCo's own image at our quality, without shadows and reflections."""
    renderer, shown = rendering.open_renderer(robot.model), mujoco.MjvOption()
    shown.flags[mujoco.mjtVisFlag.mjVIS_TENDON] = tendons
    renderer.update_scene(robot.data, camera, shown)
    for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
        renderer.scene.flags[flag] = False
    picture = renderer.render()
    renderer.close()
    return picture


@pytest.mark.parametrize("camera", ["eye", "outside"])
@pytest.mark.parametrize("scene", ["posture", "can_grasp"])
def test_floor_and_tendons_have_the_pixels_of_mujoco(scene: str, camera: str) -> None:
    robot = Robot(asset_path(f"mjcf/kengoro_arm/{scene}.xml"))
    robot.reset(posture_set()[0], np.random.default_rng(0))
    painter = Painter(robot.model)
    picture = painter.draw(robot.data, camera)
    painter.close()
    full = rendered_in_full(robot, camera).astype(int)
    boxes, without_tendons = (
        np.abs(other - full).max(axis=2)
        for other in (picture, rendered_in_full(robot, camera, tendons=False))
    )
    # Tendons alone differ, by their shading; without the floor half of the pixels would.
    assert np.mean(boxes > 10) < 0.01
    # They are where MuJoCo draws them.
    assert np.mean(boxes > 60) < 0.5 * np.mean(without_tendons > 60)


SKY = """
<mujoco>
  <asset><texture type="skybox" builtin="flat" rgb1="0 0 1" width="8" height="8"/></asset>
  <worldbody><geom type="plane" size="3 3 1"/><camera name="eye" {}/></worldbody>
</mujoco>
"""


def test_a_plane_hides_from_above_what_is_behind_it() -> None:
    above, below = (
        painted(mujoco.MjModel.from_xml_string(SKY.format(f'pos="{pose}" fovy="90"')), "eye")
        for pose in ("0 0 1", '0 0 -1" euler="180 0 0')
    )
    red, _, blue = above[240, 320].astype(int)
    assert red == blue
    red, _, blue = below[240, 320].astype(int)
    assert blue > red + 50  # the sky shines through


def test_a_painter_leaves_the_models_quality_to_others() -> None:
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><visual><quality numslices='20'/><global offwidth='800'/></visual>"
        "<worldbody><geom size='1'/><camera name='eye' pos='0 0 4'/></worldbody></mujoco>"
    )
    painter, data = Painter(model), mujoco.MjData(model)
    painter.draw(data, "eye")
    painter.close()
    quality = model.vis.quality
    assert (quality.numslices, quality.offsamples, quality.shadowsize) == (20, 4, 4096)
    assert (model.vis.global_.offwidth, model.vis.global_.offheight) == (800, 480)


DELETED_IN_A_THREAD = """
import gc, threading
import mujoco
from kengoro_env.vision.rendering import Painter
model = mujoco.MjModel.from_xml_string(
    '<mujoco><worldbody><camera name="eye"/><geom size="0.1" pos="0 0 -1"/></worldbody></mujoco>'
)
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
painters = [Painter(model)]
painters[0].draw(data, "eye")
thread = threading.Thread(target=lambda: (painters.clear(), gc.collect()))
thread.start()
thread.join()
print(Painter(model).draw(data, "eye").shape)
"""


def test_a_painter_may_be_deleted_in_another_thread() -> None:
    ended = python(DELETED_IN_A_THREAD)
    assert ended.stdout.strip() == "(480, 640, 3)"
    assert ended.stderr == ""


IMAGES_IN_THREADS = """
import threading
import gymnasium, kengoro_env, numpy as np
env = gymnasium.make("Kengoro/Elbow-v0", render_mode="rgb_array")
env.reset(seed=0)
expected = env.render()
def compare():
    print(all(np.array_equal(env.render(), expected) for _ in range(3)))
for together in (1, 1, 4):  # one after the other, then at once
    threads = [threading.Thread(target=compare) for _ in range(together)]
    for thread in threads: thread.start()
    for thread in threads: thread.join()
    compare()
thread = threading.Thread(target=env.close)
thread.start()
thread.join()
compare()
"""


def test_any_thread_may_render() -> None:
    ended = python(IMAGES_IN_THREADS)
    assert ended.stdout.split() == ["True"] * 10, ended.stderr
    assert ended.stderr == ""


FORKED = """
import gc, os, sys
import gymnasium, kengoro_env
before = gymnasium.make("Kengoro/Elbow-v0", render_mode="rgb_array")
before.reset(seed=0)
if sys.argv[1] == "image": before.render()
child = os.fork()
if child == 0:
    after = gymnasium.make("Kengoro/Elbow-v0", render_mode="rgb_array")
    after.reset(seed=0)
    for env in (before, after):
        try:
            print(env.render().shape)
        except kengoro_env.KengoroError as error:
            print(error)
        env.close()
    del before, after, env
    gc.collect()
    sys.exit()
_, status = os.waitpid(child, 0)
print(os.waitstatus_to_exitcode(status), before.render().shape)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
@pytest.mark.parametrize("rendered", [True, False])
def test_a_fork_after_an_image_reports_that_it_cannot_render(rendered: bool) -> None:
    before = f"import sys; sys.argv = ['', '{'image' if rendered else ''}']\n"
    ended = python(before + FORKED)
    assert ended.stderr == ""
    *forked, parent = ended.stdout.splitlines()
    assert parent == "0 (480, 640, 3)"
    if rendered:
        assert len(forked) == 2
        for line in forked:
            assert line.startswith("this process was forked from one that had rendered an image")
            assert 'AsyncVectorEnv(..., context="spawn")' in line
    else:
        assert forked == ["(480, 640, 3)"] * 2


ASYNC = """
import gymnasium, kengoro_env
if __name__ == "__main__":
    drawn = gymnasium.make("Kengoro/Elbow-v0", render_mode="rgb_array")
    drawn.reset(seed=0)
    drawn.render()
    envs = gymnasium.make_vec(
        "Kengoro/Posture-v0", 2, "async", {{"context": "{context}"}}, camera=True
    )
    try:
        print(envs.reset(seed=0)[0]["frame"].shape)
    except kengoro_env.KengoroError as error:
        print(error)
    envs.close()
"""


@pytest.mark.parametrize(
    ("context", "result"),
    [("fork", "this process was forked from one that had"), ("spawn", "(2, 480, 640, 3)")],
)
def test_processes_of_gymnasium_render_or_name_the_reason(context: str, result: str) -> None:
    assert python(ASYNC.format(context=context)).stdout.startswith(result)
