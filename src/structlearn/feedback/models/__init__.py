"""Feedback networks, one per module, which `params.yaml` picks by the module's name (`network: pmnn`).

A module in a folder that the environment variable STRUCTLEARN_NETWORKS lists is found by its name too.
"""

import os

__path__ += filter(None, os.environ.get("STRUCTLEARN_NETWORKS", "").split(os.pathsep))
