"""Rigid-body dynamics of arms read from URDFs: Newton-Euler, inertial parameters, and learned models.

The public names are listed in the stub beside this file; their modules load on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
