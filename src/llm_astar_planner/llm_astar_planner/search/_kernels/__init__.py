"""The compiled inner loops of the searches (numba)."""
