"""Bench rigs and published reference data. Rigs take port URLs and never know whether a board is simulated."""
