"""From residuals to causes: noise model, evidence, fits, search and verdict."""
