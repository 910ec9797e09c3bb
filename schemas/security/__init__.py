"""What keeps files of strangers from running code, reaching other files, or taking more than they may."""
