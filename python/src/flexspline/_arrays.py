"""What people have as arrays: NumPy, lists, pandas, Polars, Arrow. None of these but NumPy is imported here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._errors import InputError

Floats = NDArray[np.float64]


def floats(values: Any, name: str) -> Floats:
    """One column as floats; what is missing is NaN."""
    array = _array(values, name)
    if array.dtype.kind not in "fiu":
        raise InputError(f"{name}: holds {array.dtype}, not numbers; convert it with `.astype(float)`{_hint(array)}")
    if array.ndim != 1:
        raise InputError(f"{name}: has {array.ndim} axes; give one value a row")
    return np.asarray(array, dtype=np.float64)


def seconds(values: Any, name: str) -> Floats:
    """Times as seconds; dates become seconds since the first."""
    array = _array(values, name)
    if array.ndim == 1 and array.dtype.kind in "mM":
        try:
            since = array - array[:1] if array.dtype.kind == "M" else array
            array = since / np.timedelta64(1, "s")
        except TypeError:
            raise InputError(f"{name}: {array.dtype} cannot be told in seconds; convert it to seconds") from None
    return floats(array, name)


def table(values: Any, name: str, width: int) -> Floats:
    """Rows of so many floats, or one of them."""
    array = _array(values, name)
    if array.dtype.kind not in "fiu":
        raise InputError(f"{name}: holds {array.dtype}, not numbers; convert it with `.astype(float)`")
    if array.ndim not in (1, 2) or array.shape[-1] != width:
        raise InputError(f"{name}: has the shape {array.shape}; the robot has {width} joints, so give (rows, {width})")
    return np.asarray(array, dtype=np.float64)


def columns_of(table: Any) -> list[tuple[str, Floats]] | None:
    """Columns of a data frame or table that has names for them; `None` if it is none."""
    if isinstance(table, Mapping):
        names = list(table)
        column = table.__getitem__
    elif hasattr(table, "column_names") and hasattr(table, "column"):
        names, column = list(table.column_names), table.column
    elif hasattr(table, "columns") and hasattr(table, "__getitem__"):
        names, column = list(table.columns), table.__getitem__
    else:
        return None
    converted = []
    for name in names:
        text = str(name)
        told = f"column `{text}`"
        values = column(name)
        array = _array(values, told)
        if array.dtype.kind in "mM":
            converted.append((text, seconds(array, told)))
        elif array.dtype.kind in "fiu" or "." in text or text == "time_s":
            converted.append((text, floats(array, told)))
        # text and flags beside the measurements tell nothing of a joint
    return converted


def _array(values: Any, name: str) -> NDArray[Any]:
    """A NumPy array, missing values NaN."""
    try:
        array = _numpy(values)
        if isinstance(array, np.ma.MaskedArray):
            array = np.ma.filled(array.astype(np.float64), np.nan)
        return np.asarray(array)
    except Exception as error:
        raise InputError(f"{name}: is no array of numbers ({_one_line(error)})") from None


def _numpy(values: Any) -> Any:
    """An array, or what NumPy makes one of, of a column of another library."""
    module = type(values).__module__.split(".")[0]
    if module == "pandas" and getattr(values.dtype, "kind", "O") in "fiu" and not isinstance(values.dtype, np.dtype):
        return values.to_numpy(dtype=np.float64, na_value=np.nan)
    if module == "pyarrow":
        return values.to_numpy(zero_copy_only=False) if hasattr(values, "null_count") else np.asarray(values)
    return values


def _hint(array: NDArray[Any]) -> str:
    return ", missing values as NaN" if array.dtype.kind == "O" else ""


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())
