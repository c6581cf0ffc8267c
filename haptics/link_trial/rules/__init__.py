"""The rules of the protocol, by subject; each tries one promise on a board."""
