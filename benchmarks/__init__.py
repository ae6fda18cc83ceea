"""Side-by-side measurements for developers; not shipped."""
