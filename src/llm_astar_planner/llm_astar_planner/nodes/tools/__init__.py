"""Clients of a running graph: call it, watch it, record it."""
