"""The plot directive of matplotlib in pages of Markdown.

The directive puts lines of reStructuredText in front of the parser. That of Markdown takes none, so they are parsed
where they stand.
"""

from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from matplotlib.sphinxext.plot_directive import PlotDirective
from sphinx.application import Sphinx


class _Lines:
    """Stands for the state machine, and keeps the lines that the directive makes."""

    def __init__(self, document: nodes.document) -> None:
        self.document = document
        self.made: list[str] = []

    def insert_input(self, lines: list[str], source: str) -> None:
        self.made += lines


class Plot(PlotDirective):  # type: ignore[misc]
    """The directive for pages of Markdown."""

    def run(self) -> list[Any]:
        """The figure, and the code where it is asked for."""
        lines = self.state_machine = _Lines(self.state.document)
        errors = super().run()
        place = nodes.Element()
        fenced = ["``````{eval-rst}", *lines.made, "``````"]
        self.state.nested_parse(StringList(fenced, self.state.document["source"]), 0, place)
        return [*errors, *place.children]


def setup(app: Sphinx) -> dict[str, bool]:
    """Put it in the place of matplotlib's own, whose settings stay."""
    app.setup_extension("matplotlib.sphinxext.plot_directive")
    app.add_directive("plot", Plot, override=True)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
