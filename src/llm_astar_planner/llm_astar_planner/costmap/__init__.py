"""A map under rules: what is blocked, what cells cost, what is connected."""
