"""Orders of triggers to actors: how each kind is carried out, and which are in force."""
