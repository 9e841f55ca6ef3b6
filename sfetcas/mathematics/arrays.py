"""Types of arrays; shapes, units and frames stand in the docstrings."""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = ["Array", "Index"]

Array = np.ndarray[Any, np.dtype[Any]]
"""An array of numbers."""

Index = np.ndarray[Any, np.dtype[np.intp]]
"""An array of places in another one."""
