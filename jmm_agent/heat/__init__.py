"""Heat of the motors: thermal model, its online estimation, faults, and limits of tensions."""
