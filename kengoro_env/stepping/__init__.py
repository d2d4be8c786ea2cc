"""Control steps of one robot or of many robots, by compiled C code or by NumPy."""
