"""The bench's patch: a square of cloth between two clamps, its mesh and the layouts of its reinforcement (thesis 5.6.1)."""
