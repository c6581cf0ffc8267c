"""Simulated boards behind ``sim://``: firmware state machines around physical plants, at the end of a paced serial line.

pyserial loads ``firmware_models.protocol_sim`` by name when a program opens ``sim://tactiles`` or ``sim://brake``; nothing
here needs to be imported for that. ``haptics link simulate`` serves a board behind a pseudo-terminal instead.
"""
