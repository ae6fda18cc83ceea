"""Instructions understood by a language model, and held against the sentence word by word."""
