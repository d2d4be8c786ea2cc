"""Strange robots: eight kinds of robots that the preset's departures do not describe."""
