"""What people decided about findings, and how the findings of a campaign compare with those of the previous one."""
