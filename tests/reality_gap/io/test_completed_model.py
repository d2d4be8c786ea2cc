"""Models with a name and a sensor for all that a log may contain."""

from __future__ import annotations

import mujoco

from reality_gap.io.completed_model import complete_model


def test_two_actuators_without_names_on_one_joint_get_two_names() -> None:
    spec = mujoco.MjSpec.from_string(
        '<mujoco><worldbody><body><joint name="j"/><geom size=".1"/></body></worldbody>'
        '<actuator><motor joint="j"/><motor joint="j"/></actuator></mujoco>'
    )
    found, added = complete_model(spec)
    assert [actuator.name for actuator in found.actuators] == ["j", "j_2"]
    assert added == ("j_position", "j_velocity", "j_force", "j_2_force")
    found.compile()
