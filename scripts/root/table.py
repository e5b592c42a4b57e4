"""A table of text, which a terminal, a Markdown file and a notebook show alike."""

from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Table:
    """Rows of cells below headings.

    Attributes:
        headings: one for each column.
        rows: as many cells each as there are headings.
        title: a line above it; may be empty.
        left: how many of the first columns are aligned to the left; the others are numbers, aligned to the right.
    """

    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    title: str = ""
    left: int = 1

    def markdown(self) -> str:
        """The table in Markdown, without its title."""
        ruler = ("---",) * self.left + ("---:",) * (len(self.headings) - self.left)
        return "\n".join("| " + " | ".join(row) + " |" for row in (self.headings, ruler, *self.rows))

    def __str__(self) -> str:
        """The table in columns for a terminal."""
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        if self.title:
            yield self.title
        rows = (self.headings, *self.rows)
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        for row in rows:
            cells = (
                cell.ljust(width) if k < self.left else cell.rjust(width)
                for k, (cell, width) in enumerate(zip(row, widths, strict=True))
            )
            yield "  ".join(cells).rstrip()

    def _repr_markdown_(self) -> str:
        return f"{self.title}\n\n{self.markdown()}" if self.title else self.markdown()
