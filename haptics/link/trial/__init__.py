"""Trials of a link: faults on its line, and what comes of them."""
