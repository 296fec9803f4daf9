"""Feedback networks, one per module; files of networks and skills name the module (`pmnn`).

Modules in folders listed in the environment variable STRUCTLEARN_NETWORKS are found by name too.
"""

import os

__path__ += filter(None, os.environ.get("STRUCTLEARN_NETWORKS", "").split(os.pathsep))
