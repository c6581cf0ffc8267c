"""A real browser, for pages that people look at."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
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
  out.textContent = JSON.stringify({figures, wide: document.documentElement.scrollWidth > window.innerWidth + 1});
  document.body.appendChild(out);
});
</script>
"""


class Browser:
    """Chromium without a window."""

    def __init__(self, program: str, folder: Path):
        self._program, self._folder = program, folder

    def measure(self, page: Path, width: int = 1280) -> dict:
        """What the page looks like at that width: figures with their words and sizes, and whether it is too wide."""
        copy = self._folder / f"measured-{width}.html"
        copy.write_text(page.read_text(encoding="utf-8").replace("</body>", _MEASURE + "</body>"), encoding="utf-8")
        dom = self._run(copy, width, "--dump-dom")
        found = re.search(r'<pre id="measured">(.*?)</pre>', dom, re.S)
        assert found is not None, dom[-2000:]
        return json.loads(unescape(found.group(1)))

    def screenshot(self, page: Path, width: int = 1280, height: int = 4000) -> NDArray[np.uint8]:
        """The page as pixels (height, width, 3)."""
        import matplotlib.image

        picture = self._folder / "page.png"
        self._run(page, width, f"--screenshot={picture}", height=height)
        return (matplotlib.image.imread(picture)[:, :, :3] * 255).astype(np.uint8)

    def _run(self, page: Path, width: int, *more: str, height: int = 4000) -> str:
        words = [
            self._program,
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--hide-scrollbars",
            f"--user-data-dir={self._folder / 'profile'}",
            f"--window-size={width},{height}",
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
