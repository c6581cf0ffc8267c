"""A test bench for a link and its board: conformance to the protocol, stress over a bad line, and watching."""
