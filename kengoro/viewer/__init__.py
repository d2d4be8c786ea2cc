"""Watch a robot: in a window, in a browser, or as a film."""
