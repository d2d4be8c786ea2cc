"""Units of commands, compared with what MuJoCo does with a constant command."""

from __future__ import annotations

import mujoco
import pytest

from reality_gap.io.dimensions import actuator_units

SERVOS = {
    "position": '<position name="a" joint="j" kp="400" kv="40"/>',
    "filtered position": '<position name="a" joint="j" kp="400" kv="40" timeconst="0.05"/>',
    "velocity": '<velocity name="a" joint="j" kv="40"/>',
    "intvelocity": '<intvelocity name="a" joint="j" kp="400" kv="10" actrange="-10 10"/>',
    "general": '<general name="a" joint="j" dyntype="integrator" gainprm="400" biastype="affine" '
    'biasprm="0 -400 -10" actlimited="true" actrange="-10 10"/>',
}


@pytest.mark.parametrize(("joint", "position"), [("hinge", "rad"), ("slide", "m")])
@pytest.mark.parametrize("servo", SERVOS)
def test_a_servo_is_commanded_in_what_follows_its_command(
    servo: str, joint: str, position: str
) -> None:
    """After 2 s of the command 0.5, either the position or the velocity is close to 0.5."""
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><option gravity="0 0 0"/><worldbody><body>'
        f'<joint name="j" type="{joint}" armature="1"/><geom size=".1" mass="1"/>'
        "</body></worldbody>"
        f"<actuator>{SERVOS[servo]}</actuator></mujoco>"
    )
    data = mujoco.MjData(model)
    data.ctrl[0] = 0.5
    while data.time < 2.0:
        mujoco.mj_step(model, data)
    follows = {position: float(data.qpos[0]), f"{position}/s": float(data.qvel[0])}
    unit = min(follows, key=lambda unit: abs(follows[unit] - 0.5))
    assert follows[unit] == pytest.approx(0.5, abs=0.05)
    assert actuator_units(model, "a") == (unit,)


def test_an_integrated_servo_of_the_velocity_may_have_any_unit() -> None:
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><joint name="j"/><geom size=".1"/></body></worldbody><actuator>'
        '<general name="a" joint="j" dyntype="integrator" gainprm="2" biastype="affine" '
        'biasprm="0 0 -2"/></actuator></mujoco>'
    )
    assert actuator_units(model, "a") == ()
