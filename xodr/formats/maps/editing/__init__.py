"""OpenDRIVE files changed as files: cut, placed elsewhere, joined; elements that are not touched
stay as they were written."""
