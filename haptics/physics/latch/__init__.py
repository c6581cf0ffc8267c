"""The bistable tactor: a pin that a pulse switches between two latches (thesis 3.4). ``pulse`` is its ladder."""
