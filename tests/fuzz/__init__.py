"""Hostile files for everything that reads files: `make fuzz`, minutes a format, not in `make test`.

Valid files (`targets`) are changed at random (`mutations`) and read in a process of their own
(`__main__`). Each has to be read, or refused by one of the program's own errors on one line,
within seconds, without a word of a library on standard error.
"""
