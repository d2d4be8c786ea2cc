"""Tools that build, check and try this repository; they are not part of the distributions."""
