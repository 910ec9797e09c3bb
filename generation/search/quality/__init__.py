"""Quality-diversity search: many failures that differ, found on the twin, judged on SUMO."""
