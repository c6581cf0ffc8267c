"""Cutting a garment out of a body's skin, made finer and coarser."""
