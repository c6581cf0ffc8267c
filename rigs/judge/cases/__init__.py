"""The questions put to both, model and circuit simulator."""
