"""Published reference data: what the thesis states, with the section, how sure it is, and what the project made of it.

Numbers, curves and contradictions are TOML files in this folder, typed off the text and never taken from a model.
"""

from rigs.reference.library import (
    all_curves,
    all_published,
    contradictions,
    contradictions_of,
    curve,
    published,
)
from rigs.reference.published import Contradiction, Curve, CurvePoint, Passage, Published, Verdict

__all__ = [
    "Contradiction",
    "Curve",
    "CurvePoint",
    "Passage",
    "Published",
    "Verdict",
    "all_curves",
    "all_published",
    "contradictions",
    "contradictions_of",
    "curve",
    "published",
]
