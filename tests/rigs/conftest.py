"""A real browser, for pages that people look at."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import dataclass
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

# What a reader would trip over: measured in the browser, after layout.
_MEASURE = """
<script>
window.addEventListener("load", () => {
  const figures = [...document.querySelectorAll("figure svg")].map(svg => {
    const box = svg.getBoundingClientRect();
    const texts = [...svg.querySelectorAll("text")].filter(t => t.textContent.trim());
    const boxes = texts.map(t => t.getBoundingClientRect());
    return {
      width: box.width, height: box.height,
      words: texts.map(t => t.textContent.trim()),
      smallest: Math.min(...boxes.map(b => Math.min(b.width, b.height))),
      outside: texts.filter((t, k) => boxes[k].left < box.left - 1 || boxes[k].right > box.right + 1 ||
        boxes[k].top < box.top - 1 || boxes[k].bottom > box.bottom + 1).map(t => t.textContent.trim()),
    };
  });
  const out = document.createElement("pre");
  out.id = "measured";
  out.hidden = true;  // what a reader sees is without it
  out.textContent = JSON.stringify({figures, wide: document.documentElement.scrollWidth > window.innerWidth + 1});
  document.body.appendChild(out);
});
</script>
"""


@dataclass(frozen=True)
class Look:
    """A page as it was laid out and painted.

    :param seen: figures with their words and sizes, and whether the page is too wide.
    :param pixels: (height, width, 3), 0 to 255.
    """

    seen: dict
    pixels: NDArray[np.uint8]

    def count(self, red: int, green: int, blue: int) -> int:
        """Pixels of this colour, each part within 30."""
        near = np.ones(self.pixels.shape[:2], dtype=bool)
        for k, part in enumerate((red, green, blue)):
            plane = self.pixels[:, :, k]
            near &= (plane > part - 30) & (plane < part + 30)
        return int(near.sum())


class Browser:
    """Chromium without a window."""

    def __init__(self, program: str, folder: Path):
        self._program, self._folder = program, folder

    def look(self, page: Path, width: int = 1280, height: int = 4000) -> Look:
        """What the page looks like in a window of that size; layout and picture are of one load."""
        from PIL import Image

        copy, picture = self._folder / "looked-at.html", self._folder / "page.png"
        copy.write_text(page.read_text(encoding="utf-8").replace("</body>", _MEASURE + "</body>"), encoding="utf-8")
        picture.unlink(missing_ok=True)
        dom = self._run(copy, f"--window-size={width},{height}", "--dump-dom", f"--screenshot={picture}")
        found = re.search(r'<pre id="measured"[^>]*>(.*?)</pre>', dom, re.S)
        assert found is not None, dom[-2000:]
        with Image.open(picture) as image:
            pixels = np.asarray(image.convert("RGB"))
        assert pixels.shape[:2] == (height, width)
        return Look(json.loads(unescape(found.group(1))), pixels)

    def _run(self, page: Path, *more: str) -> str:
        words = [
            self._program,
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--hide-scrollbars",
            f"--user-data-dir={self._folder / 'profile'}",
            "--virtual-time-budget=5000",
            *more,
            page.resolve().as_uri(),
        ]
        done = subprocess.run(words, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
        return done.stdout


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Browser:
    """Chromium; without it the pages are not looked at."""
    program = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if program is None:
        pytest.skip("no chromium here to look at the pages with")
    return Browser(program, tmp_path_factory.mktemp("browser"))
