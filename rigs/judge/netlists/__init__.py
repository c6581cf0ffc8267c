"""The circuits that ngspice is given."""
