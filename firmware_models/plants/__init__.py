"""What a board's pins drive: the physics of ``haptics.physics`` as world nanoseconds, channels and faults."""
