"""The diagnosis on trial: hidden effects, and how often it is right."""
