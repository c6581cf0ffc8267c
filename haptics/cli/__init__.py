"""The ``haptics`` command: arguments in, one library call, a table or JSON out."""
