"""Campaigns: plan the whole method over many scenarios, run it in parallel, and keep the failures."""
