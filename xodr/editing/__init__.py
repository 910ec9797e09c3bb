"""OpenDRIVE files changed as text: parts cut out; all that is not touched stays as it was written."""
