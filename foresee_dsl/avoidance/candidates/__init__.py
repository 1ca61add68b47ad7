"""Finds the moments of a run that hide a failure which a careful driver would avoid, by trying changed behaviours."""
