"""Names of the arm's joints and of their four groups, in the order of all arrays.

Muscles have the names and the order of the tendons in ``arm.xml``.
"""

GROUP_JOINTS: dict[str, tuple[str, ...]] = {
    "neck": ("neck_yaw", "neck_pitch", "neck_roll"),
    "scapula": ("sc_roll", "sc_yaw", "ac_roll", "ac_pitch"),
    "shoulder": ("sh_pitch", "sh_roll", "sh_yaw", "elbow"),
    "forearm": ("radioulnar", "wrist_flex", "wrist_dev"),
}
"""Joints of each group, from proximal to distal (paper, sec. II-A and IV)."""

JOINTS: tuple[str, ...] = tuple(joint for joints in GROUP_JOINTS.values() for joint in joints)
"""The 14 joints of head and arm, without the fingers."""

FINGER_JOINTS: tuple[str, ...] = (
    "finger_proximal",
    "finger_distal",
    "thumb_proximal",
    "thumb_distal",
)
