"""Reports for people and tools: pages, terminal reports, reports for build servers, pictures and playbacks."""
