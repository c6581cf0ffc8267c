"""Table 5.1 of the thesis beside the same designs made here."""
