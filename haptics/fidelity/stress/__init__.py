"""Every model at its extremes: a tally of questions for each, and the run over all."""
