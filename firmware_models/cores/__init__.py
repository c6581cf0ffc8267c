"""The C firmware behind the same port: built on demand, compiled for this machine or on a simulated ATmega328P."""
