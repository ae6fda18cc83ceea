"""The prompts that a model is asked with, and the parser of its replies."""
