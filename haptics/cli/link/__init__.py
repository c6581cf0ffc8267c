"""``haptics ports``, ``haptics off`` and the ``haptics link`` group."""
