"""The whole method over many scenarios: plan, run in parallel, keep what fails."""
