"""Kengoro's robot and agent joined: environments, agents, sessions, recordings, one's own robot.

The public names below are imported when they are first used; ``__init__.pyi`` lists them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
