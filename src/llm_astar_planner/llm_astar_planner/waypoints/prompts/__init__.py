"""What the model is asked, and how its replies are read."""
