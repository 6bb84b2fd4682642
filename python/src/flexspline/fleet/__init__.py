"""Many recordings of many robots: each diagnosed once, and what the whole fleet says.

`diagnose` writes a partitioned Parquet dataset, on this machine, on Ray or on Dask. `summary` reads it: which effect is
common to the fleet, which robot is unlike the others, and what drifts.
"""

from ._dataset import SCHEMA
from ._diagnosis import Done, SetAside, diagnose
from ._summary import Summary, summary

__all__ = ["SCHEMA", "Done", "SetAside", "Summary", "diagnose", "summary"]
