"""The two updaters: which pair is learned, and when (paper, sec. II-C, III-B, III-C).

Both learn when the lengths have settled at a posture far enough from that of their last update.
"""

from jmm_agent.updaters.antagonism import AntagonismMemory, AntagonismOptions, AntagonismUpdater
from jmm_agent.updaters.vision import VisionUpdater
from jmm_agent.updaters.vision_memory import Seen, VisionMemory
from jmm_agent.updaters.vision_options import PairLengths, VisionOptions

__all__ = [
    "AntagonismMemory",
    "AntagonismOptions",
    "AntagonismUpdater",
    "PairLengths",
    "Seen",
    "VisionMemory",
    "VisionOptions",
    "VisionUpdater",
]
