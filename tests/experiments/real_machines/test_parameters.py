"""Parameters that the baselines of measured machines free."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from experiments.real_machines.parameters import expand, predict
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.study.measurements import measured

MODEL = """<mujoco><worldbody><body><joint name="axis" axis="0 1 0" damping="0.5"
frictionloss="0.2" armature="0.01"/><geom type="sphere" size="0.05" pos="0 0 -0.3" mass="1"/></body>
</worldbody><actuator><position name="servo" joint="axis" kp="20"/></actuator>
<sensor><jointpos name="angle" joint="axis"/></sensor></mujoco>"""
WITHOUT = {"damping": -0.5, "friction": -0.2, "armature": -0.01}


def test_what_a_model_has_too_much_of_may_be_taken_away(tmp_path: Path) -> None:
    path, bare = tmp_path / "model.xml", tmp_path / "bare.xml"
    path.write_text(MODEL)
    bare.write_text(
        MODEL.replace('damping="0.5"', "")
        .replace('frictionloss="0.2"', "")
        .replace('armature="0.01"', "")
    )
    time = np.arange(0.0, 4.0, 0.01)
    command = 0.4 * np.sin(3.0 * time)[:, None]
    episode = Episode("waves", time, command, (Reading(time, 0.0 * time),))
    channel = Channel("angle", "angle", unit="rad", noise=1e-3)
    study, other = (Study("one", x, (channel,), (episode,)) for x in (path, bare))

    free = {one.key: one for one in expand(study, tuple(WITHOUT))}
    found = predict(study, measured(study), WITHOUT)

    assert {key: one.low for key, one in free.items()} == WITHOUT
    np.testing.assert_allclose(found, predict(other, measured(other), {}), atol=1e-9)
