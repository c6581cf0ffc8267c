"""What judges a run: when touches should have been felt, what the plants did, and whether a plan was good enough."""
