"""The rows of results and the folders that hold them."""
