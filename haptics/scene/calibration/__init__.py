"""Where the tactors sit on one person's hand: the calibration, its file, and the routine of poses that makes one."""
