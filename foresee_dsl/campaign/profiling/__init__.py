"""Where the time goes: by part of the tool, measured from outside, and only where it is asked for (`--profile`)."""
