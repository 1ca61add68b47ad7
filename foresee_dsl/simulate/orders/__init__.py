"""Orders of triggers to actors: what each asks for, and which are in force."""
