"""A robot: its model, tendons, muscles and sensors."""
