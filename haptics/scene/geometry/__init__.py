"""Rigid poses, and shapes as signed distances."""
