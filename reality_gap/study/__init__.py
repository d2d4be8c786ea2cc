"""Study: a model and the measurements of its machine, and what they offer to a diagnosis."""
