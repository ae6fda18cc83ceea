"""Training of the embedded waypoint model: maps, labels, network, trainer and evaluation."""
