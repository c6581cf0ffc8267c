"""What each ladder of levels is asked, to measure its error: drawn and published cases by model."""
