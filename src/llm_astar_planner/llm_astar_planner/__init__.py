"""LLM-A*: a global planner that a language model's waypoints guide (arXiv 2407.02511)."""

__version__ = '0.1.0'
