"""What carries out the runs of a campaign: processes of this machine, or the workers of a dask cluster.

An engine takes cases and gives the lines of their runs as they end, the same lines whichever it is.
"""

from baryscope.study.campaign.engines.cluster import ClusterEngine, connected
from baryscope.study.campaign.engines.engine import Engine
from baryscope.study.campaign.engines.local import LocalEngine, usable_cores

__all__ = ["ClusterEngine", "Engine", "LocalEngine", "connected", "usable_cores"]
