"""The command line: parse, call, report. One module per command; none of them computes."""
