"""What device tolerances do to what is felt, and how much of it a bench takes away: ``rigs.tolerance.study.tolerance_study``.

``draws`` holds what varies, ``calibration`` what a host assumes before and after a bench, ``pin``, ``heat`` and ``brake`` what
one device then makes felt, ``felt`` gathers it, ``study`` runs many devices. Empty, because the command line imports it at start.
"""
