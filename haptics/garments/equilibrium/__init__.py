"""The garment as worn: membrane, contact, Newton's method, and the motion from angle to angle."""
