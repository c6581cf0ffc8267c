"""What a person looks at: curves as pictures, and one self-contained page (extra ``report``)."""

from rigs.report.figures import png_bytes, svg_text
from rigs.report.page import Block, Page, render_page

__all__ = ["Block", "Page", "png_bytes", "render_page", "svg_text"]
