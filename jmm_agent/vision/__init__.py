"""The camera: marker poses, what they say of the joints, and the fit of many of them."""
