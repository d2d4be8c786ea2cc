"""Names of the arm's joints and of the four groups, in the order used everywhere.

Muscles are not listed here: their names and order are those of the tendons in ``arm.xml``.
"""

GROUP_JOINTS: dict[str, tuple[str, ...]] = {
    "neck": ("neck_yaw", "neck_pitch", "neck_roll"),
    "scapula": ("sc_roll", "sc_yaw", "ac_roll", "ac_pitch"),
    "shoulder": ("sh_pitch", "sh_roll", "sh_yaw", "elbow"),
    "forearm": ("radioulnar", "wrist_flex", "wrist_dev"),
}
"""Joints that each group owns, from proximal to distal (paper, sec. II-A and IV)."""

JOINTS: tuple[str, ...] = tuple(joint for joints in GROUP_JOINTS.values() for joint in joints)
"""The 14 joints of head and arm; fingers are not among them."""

FINGER_JOINTS: tuple[str, ...] = (
    "finger_proximal",
    "finger_distal",
    "thumb_proximal",
    "thumb_distal",
)
