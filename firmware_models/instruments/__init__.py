"""Bench instruments behind ``sim://``: thermocouple, load cell, accelerometer, high-voltage probe, stage."""
