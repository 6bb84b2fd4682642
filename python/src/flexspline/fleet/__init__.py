"""Many recordings of many robots: each diagnosed once, and what the whole fleet says.

`diagnose` writes a partitioned Parquet dataset, on this machine, on Ray or on Dask. `summary` reads it: which effect is
common to the fleet, which robot is unlike the others, and what drifts.
"""

from typing import TYPE_CHECKING

from ._dataset import SCHEMA
from ._diagnosis import Done, SetAside, diagnose

if TYPE_CHECKING:
    from ._summary import Summary, summary

__all__ = ["SCHEMA", "Done", "SetAside", "Summary", "diagnose", "summary"]


def __getattr__(name: str) -> object:
    # A worker needs neither data frames nor statistics, which cost it 0.8 s and 89 MiB.
    if name in ("Summary", "summary"):
        from . import _summary

        return getattr(_summary, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
