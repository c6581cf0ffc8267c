"""Heat of a tactor: one node or two, for single pulses and for trains (thesis 3.5.2)."""
