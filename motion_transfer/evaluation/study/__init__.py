"""A user study as in the paper's Sec. 4.3: a page of pairs for readers; what answers say."""
