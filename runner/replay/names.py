"""Names of the pages in the folders of results."""

REPLAY = "replay.html"
"""A run's page, in the folder of its results"""
REPORT = "report.html"
"""A batch's page, in its output folder"""
TO_REPORT = f"../{REPORT}"
"""The address of a batch's page, from the pages of its runs"""
