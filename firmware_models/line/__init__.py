"""The serial line between port and board: bytes paced by the baud rate, and what a bad line does to them."""
