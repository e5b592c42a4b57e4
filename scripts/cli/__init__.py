"""The command line, `baryscope`: one file for each command, which parses, calls baryscope.study and prints."""

from baryscope.threads import prefer_one_thread

prefer_one_thread()
