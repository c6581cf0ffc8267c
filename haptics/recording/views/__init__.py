"""Pictures and viewer files made from a finished recording."""
