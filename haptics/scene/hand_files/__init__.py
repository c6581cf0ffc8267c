"""Recordings of hands, read from the formats that trackers and this project write."""
