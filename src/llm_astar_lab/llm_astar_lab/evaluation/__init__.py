"""From recorded bags to samples, and back."""
