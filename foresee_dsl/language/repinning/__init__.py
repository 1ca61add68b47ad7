"""Stale children and their parent's edit: the plan (`repin`), its words (`text`), old versions in git (`history`)."""
