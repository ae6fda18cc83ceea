"""From a PlanRequest to a Plan."""
