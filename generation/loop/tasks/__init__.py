"""What the stages of a loop do: recognise, choose what to search, search, run."""
