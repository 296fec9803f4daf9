"""Touch on a skin with electrodes: samples, contact points, geodesics, latent space and its dynamics.

The public names are in the stub beside this file; their modules load on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
