"""What build servers read: JUnit, SARIF, GitHub's annotations, and the runs of the pytest plugin."""
