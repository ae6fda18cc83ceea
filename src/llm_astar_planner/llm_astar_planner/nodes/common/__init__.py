"""What all nodes share: spinning, parameters, QoS, tf."""
