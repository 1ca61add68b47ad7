"""Reports for build servers: JUnit, SARIF, GitHub's annotations, and the runs of the pytest plugin."""
