"""Figures that show themselves: in notebooks as the last value of a cell, in scripts by ``pyplot.show()``.

Functions that return a figure register it with pyplot, as ``pyplot.figure()`` does; ``pyplot.close(figure)`` releases
it.  What is only written to a file is not registered: it needs no window and nothing is left of it.
"""

from __future__ import annotations

import io
from typing import Any

import matplotlib
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from .files import DPI

__all__ = ["Picture", "new_figure"]


class Picture(Figure):
    """A matplotlib figure that notebooks show."""

    def _repr_png_(self) -> bytes:
        content = io.BytesIO()
        self.savefig(content, format="png", dpi=DPI)
        return content.getvalue()

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, Any]:
        """What notebooks show; a figure that is shown here is not shown once more at the end of the cell."""
        if self.canvas.manager is not None and "inline" in matplotlib.get_backend():
            from matplotlib import pyplot

            pyplot.close(self)
        return {"image/png": self._repr_png_(), "text/plain": repr(self)}


def new_figure(width: float, height: float, *, shown: bool, wspace: float = 0.02) -> Picture:
    """An empty figure of a width and height in inch, laid out by constraints; ``shown``: registered with pyplot."""
    given: dict[str, Any] = {"figsize": (width, height), "dpi": DPI}
    given["layout"] = ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.08, wspace=wspace)
    if not shown:
        return Picture(**given)
    # Pyplot looks for a window system when it is imported: what is written to files does without.
    from matplotlib import pyplot

    figure = pyplot.figure(FigureClass=Picture, **given)
    assert isinstance(figure, Picture)
    return figure
