"""Segmentation of demonstrations into primitives: zero-velocity crossing, DTW, weighted least squares (IV.5).

The public names are in the stub beside this file; their modules load on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
