"""An arm of two servos whose logs begin as their first readings show: model and study."""

ARM = """<mujoco><option timestep="{step}" integrator="{integrator}"/><worldbody>
<body><joint name="upper" axis="0 1 0" damping="0.05" armature="{rotor}"/>
<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="0.8"/>
<body pos="0.3 0 0"><joint name="lower" axis="0 1 0" damping="0.02" armature="{armature}"/>
<geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.02" mass="0.4"/></body></body></worldbody>
<actuator><position name="m_upper" joint="upper" kp="60" kv="{kv[0]}"/>
<position name="m_lower" joint="lower" kp="8" kv="{kv[1]}"/></actuator>
<sensor><jointpos name="upper" joint="upper"/><jointpos name="lower" joint="lower"/></sensor>
</mujoco>"""
STUDY = """name: arm
model: arm.xml
episodes:
  - commands: log.csv
time: {{column: time, unit: s}}
actuators:
  m_upper: {{column: m_upper, unit: rad}}
  m_lower: {{column: m_lower, unit: rad}}
sensors:
  upper: {{column: upper, unit: rad, noise: {noise}}}
  lower: {{column: lower, unit: rad, noise: {noise}}}
initial: {{joints: first_reading, settle: 0}}
"""
