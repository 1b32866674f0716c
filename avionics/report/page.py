"""The page of a report: headings, tables and figures in one HTML file without outside parts."""

import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

from matplotlib import rc_context
from matplotlib.figure import Figure

from avionics.report.plots import STYLE

CSS = """
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, "DejaVu Sans", Helvetica, Arial, sans-serif; color: #1c2430;
  background: #fff; margin: 0 auto; max-width: 1140px; padding: 24px 24px 48px; }
header { border-bottom: 3px solid #1c2430; margin-bottom: 20px; }
h1 { font-size: 28px; margin: 0; }
h2 { font-size: 20px; margin: 36px 0 8px; border-bottom: 1px solid #c9d1da; padding-bottom: 4px; }
p.sub { margin: 4px 0 14px; color: #4a5563; }
p.warn { background: #fff4e0; border-left: 4px solid #e08a00; padding: 8px 12px; }
table { border-collapse: collapse; margin: 8px 0 14px; font-variant-numeric: tabular-nums; }
th, td { padding: 4px 14px 4px 0; text-align: left; vertical-align: top;
  border-bottom: 1px solid #e4e8ed; }
th { color: #4a5563; font-weight: 600; border-bottom: 2px solid #c9d1da; }
td:first-child { white-space: nowrap; }
td.n, th.n { text-align: right; padding-left: 14px; }
figure { margin: 14px 0 26px; }
figure svg, figure img { display: block; width: 100%; height: auto; }
figcaption { color: #36404d; margin-top: 4px; max-width: 95ch; }
figcaption b { color: #1c2430; }
pre { background: #f5f7f9; padding: 12px; overflow-x: auto; font-size: 13px; }
summary { cursor: pointer; color: #1f6feb; }
@media print {
  @page { size: A4; margin: 14mm; }
  body { max-width: none; padding: 0; font-size: 11px; }
  figure, table { break-inside: avoid; }
  h2 { break-after: avoid; }
  details { display: none; }
}
"""


@dataclass(slots=True)
class Page:
    """One page, filled from top to bottom.

    Attributes
    ----------
    title, subtitle : str
        What stands at its head.
    parts : list of str
        HTML so far.
    figures : int
        Figures so far; they are numbered.
    chapter : str
        What headings begin with, e.g. "Wing left: ".
    """

    title: str
    subtitle: str
    parts: list[str] = field(default_factory=list)
    figures: int = 0
    chapter: str = ""

    def heading(self, text: str) -> None:
        """Begin a section."""
        self.parts.append(f"<h2>{escape(self.chapter + text)}</h2>")

    def paragraph(self, text: str, *, is_warning: bool = False) -> None:
        """Add plain words."""
        kind = ' class="warn"' if is_warning else ""
        self.parts.append(f"<p{kind}>{escape(text)}</p>")

    def table(self, head: Sequence[str], rows: Sequence[Sequence[str]], *, numbers: int) -> None:
        """Add a table; columns from ``numbers`` on are right-aligned figures."""

        def cells(tag: str, texts: Sequence[str]) -> str:
            return "".join(
                f"<{tag}{' class=n' if column >= numbers else ''}>{escape(text)}</{tag}>"
                for column, text in enumerate(texts)
            )

        lines = ["<table>"]
        if head:
            lines.append(f"<thead><tr>{cells('th', head)}</tr></thead>")
        lines += [f"<tr>{cells('td', row)}</tr>" for row in rows]
        self.parts.append("\n".join([*lines, "</table>"]))

    def figure(self, figure: Figure, title: str, caption: str) -> None:
        """Add a drawing with its number, title and caption."""
        self.figures += 1
        words = f"<b>Figure {self.figures}. {escape(title)}.</b> {escape(caption)}"
        drawing = svg(figure, f"f{self.figures}")
        self.parts.append(f"<figure>{drawing}<figcaption>{words}</figcaption></figure>")

    def folded(self, summary: str, text: str) -> None:
        """Add text that opens on demand."""
        inner = f"<pre>{escape(text)}</pre>"
        self.parts.append(f"<details><summary>{escape(summary)}</summary>{inner}</details>")

    def html(self) -> str:
        """Return the whole page."""
        return "\n".join(
            [
                "<!DOCTYPE html>",
                '<html lang="en"><head><meta charset="utf-8">',
                '<meta name="viewport" content="width=device-width, initial-scale=1">',
                f"<title>{escape(self.title)}</title><style>{CSS}</style></head><body>",
                f"<header><h1>{escape(self.title)}</h1>",
                f'<p class="sub">{escape(self.subtitle)}</p></header>',
                *self.parts,
                "</body></html>",
                "",
            ]
        )


def svg(figure: Figure, prefix: str) -> str:
    """Return a drawing as an SVG element; ``prefix`` keeps its names apart from other drawings."""
    buffer = io.StringIO()
    with rc_context({**STYLE, "svg.hashsalt": prefix}):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]
