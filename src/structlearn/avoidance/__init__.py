"""Obstacle avoidance: reaches around spheres, cubes and cylinders, and feedback models learned from them.

The public names are in the stub beside this file; their modules load on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
