"""Hands as 26 joints: a frame, tracks of them, what must not move anything, and the motion that ships."""
