"""A page in the browser to plan on: maps, plans and a running graph, served on loopback."""
