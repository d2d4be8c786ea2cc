"""From files to a study: YAML, logs, bags, units, and what is wrong with them."""
