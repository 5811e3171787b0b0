"""What the commands return to the shell."""

DONE, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
