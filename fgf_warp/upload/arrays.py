"""Arrays of the device's structs, from columns and without a copy: a scene may have a million instances."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp


def struct_rows(dtype: Any, count: int) -> Any:
    """Zeroed rows on the host, (count,), in the memory layout of a `wp.struct`; fields are written as columns."""
    return np.zeros(count, dtype=dtype.numpy_dtype())


def upload_structs(dtype: Any, device: str, **fields: Any) -> wp.array:
    """An array of structs from the columns of their fields, since a list of structs takes a hundred times as long.

    Args:
        dtype: the `wp.struct`.
        device: where to put them.
        **fields: for each field a column of n values; fields that are not named stay 0.

    Returns:
        (n,) structs.
    """
    rows = struct_rows(dtype, len(next(iter(fields.values()))))
    for name, values in fields.items():
        rows[name] = values
    return upload_array(rows, dtype, device)


def upload_array(values: np.ndarray, dtype: Any, device: str) -> wp.array:
    """An array on the device; on the CPU it is the same memory, so nobody may write to `values` any more."""
    return wp.array(values, dtype=dtype, device=device, copy=False)
