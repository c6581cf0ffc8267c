"""The boards in Python: one state machine for both, their commands, guards, self-test and account of heat."""
