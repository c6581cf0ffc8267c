"""The loop from poses to effects: predict the hand, decide when to act, hand effects to devices."""
