"""Recordings of hands, read from the formats in which trackers and this project leave them."""
