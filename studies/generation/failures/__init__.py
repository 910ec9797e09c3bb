"""Number of distinct, foreseeable and preventable failures of a method, and the value of the twin."""
