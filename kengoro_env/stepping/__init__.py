"""Control steps of one robot or of many, by NumPy or by compiled C code."""
