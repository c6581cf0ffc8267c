"""The electrostatic brake: volts, charge, force and what a finger feels of it (thesis 4.3, 7.2.1). ``levels`` is its ladder."""
