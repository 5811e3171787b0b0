"""The embedded demo: a small scene that is built in memory and rendered by the program."""
