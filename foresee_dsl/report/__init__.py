"""Reports for people and tools: reports for terminals, browsers and build servers, pictures and playbacks."""
