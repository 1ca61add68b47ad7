"""The paper's questions asked of this tool: which campaigns each needs, what they gave, statistics, tables, figures."""
