"""Power cycle: all muscle lengths are zeroed anew, and what was learned before is remembered."""
