"""The pictures of a report: every function draws one, from the parts of a diagnosis."""
